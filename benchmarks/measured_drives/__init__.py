"""The diagnosis of measured drives."""
