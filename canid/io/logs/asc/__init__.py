"""Vector's text format .asc."""
