"""Transfer functions, margins and reductions, by python-control."""
