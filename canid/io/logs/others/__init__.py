"""Logs of other programs, read only: each a reader, and a line of `formats.FORMS` by which its first lines are known."""
