"""Methods that are not canid's, on the same drives with the same candidates."""
