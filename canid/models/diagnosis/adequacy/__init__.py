"""Is the fitted model adequate: tests on what it leaves."""
