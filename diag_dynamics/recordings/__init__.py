"""Recordings of a robot: read, judged as the monitor judges what it receives, evaluated, and written."""
