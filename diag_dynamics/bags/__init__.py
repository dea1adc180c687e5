"""Files of messages, read and written in pieces: bytes and times, whatever they mean."""
