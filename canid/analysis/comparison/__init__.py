"""Comparison of two drivers: which parameters and causes differ, by how much, and what a difference would have to be."""
