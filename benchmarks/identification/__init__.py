"""The estimators and their peers against the Cramér-Rao bound: `python -m benchmarks identification`."""
