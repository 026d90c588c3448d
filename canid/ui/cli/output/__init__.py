"""Output of the verbs: displays of a running session, and output files."""
