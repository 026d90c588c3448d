"""Benchmarks of canid: `python -m benchmarks` lists them."""
