"""Sizes, layers, walks and words of the source tree, before and after a change."""
