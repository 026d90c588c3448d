"""Sizes, names and words of the source tree, before and after a change."""
