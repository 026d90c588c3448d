"""Several drives of one driver, diagnosed together."""
