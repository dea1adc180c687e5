"""Compiled passes over the bytes of a file of messages."""
