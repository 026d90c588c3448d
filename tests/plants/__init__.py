"""Two planting simulators, written independently of canid: drives with known effects hidden in them.

Fixtures of the tests of the diagnosis, and the drives of `python -m benchmarks.hidden_effects`.
"""
