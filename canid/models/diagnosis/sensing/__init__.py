"""The sensing block: signals that must agree with each other."""
