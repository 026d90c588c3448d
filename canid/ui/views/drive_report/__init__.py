"""Drives as self-contained HTML pages: what `identify`, `check` and `replay` write with --report."""
