"""Tables of numbers, CSV to Parquet, read in pieces as columns of joints."""
