"""Demos and the terminal view: what is started to be looked at."""
