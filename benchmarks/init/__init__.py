"""`canid init` against the right signals of public DBC files."""
