"""What is done with recorded drives at a desk: `identify`, `diagnose`, `compare` as functions, and playback."""
