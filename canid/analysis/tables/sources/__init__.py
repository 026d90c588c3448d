"""Files of columns: text, Parquet, VBO, decoded signals in MF4 and MCAP, and arrays, each as a `Source`."""
