"""Messages as bytes: the fast way from a joint state to all that is said about it. Nodes work without it."""
