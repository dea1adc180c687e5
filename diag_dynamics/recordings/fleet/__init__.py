"""Many recordings on many machines: a task for each, or for each piece of a long one, by Dask."""
