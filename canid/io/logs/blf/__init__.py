"""Vector's Binary Logging Format .blf."""
