"""ARMAX by prediction errors, batch and recursive, and its gain, lag and dead time."""
