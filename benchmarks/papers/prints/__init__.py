"""The printed numbers of both papers recomputed: `python -m benchmarks prints` writes what `canid study prints` shows."""
