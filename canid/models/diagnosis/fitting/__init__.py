"""Likelihood, least squares and intervals that the blocks share."""
