"""Signals of DBC files for `look` and `decode`: which are meant, and the page on them."""
