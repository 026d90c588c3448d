"""`canid init`, `check` and `identify` on simulated drives in the messages of public DBC files, with known truth."""
