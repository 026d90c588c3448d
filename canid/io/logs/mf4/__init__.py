"""ASAM's .mf4 with bus logging, by asammdf in a child process."""
