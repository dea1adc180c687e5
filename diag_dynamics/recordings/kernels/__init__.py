"""Recursions over the states of a recording, one after the other: what cannot be done to whole columns at once."""
