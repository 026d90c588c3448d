"""Cost of the terminal view, and pictures of it."""
