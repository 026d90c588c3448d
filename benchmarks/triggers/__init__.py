"""Cost of a triggered recording."""
