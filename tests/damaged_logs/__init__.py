"""Damaged and hostile logs, and what canid must make of them: for the tests and `python -m benchmarks damaged_logs`."""
