"""Random files in every dialect of each log format, read back."""
