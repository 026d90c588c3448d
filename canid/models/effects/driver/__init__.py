"""Effects in the driver: other responses, drifts, thresholds, episodes."""
