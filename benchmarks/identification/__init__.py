"""How near the estimators are to the statistical limit, and their peers beside them: `python benchmarks/identification`."""
