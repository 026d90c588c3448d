"""The terminal: standard streams, keys, messages, progress, and the cells of a picture."""
