"""Cost of `canid look`, against python-can and cantools on the same log."""
