"""Output of the verbs: lines and displays on the terminal, output files, and streams that cannot block a recording."""
