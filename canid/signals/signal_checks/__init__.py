"""Do the signals agree with each other: checks in estimator time, one file each; `CHECKS` is the list."""
