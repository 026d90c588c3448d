"""How many DBC files are read."""
