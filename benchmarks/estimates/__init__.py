"""Live estimates on simulated drives: against the truth, and against each other."""
