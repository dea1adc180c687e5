"""Files that an analysis writes, piece by piece; each has a temporary name until it is whole."""
