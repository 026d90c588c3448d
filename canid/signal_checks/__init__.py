"""Do the signals agree with each other: checks in estimator time, one file each; `signal_checks.CHECKS` is the list."""
