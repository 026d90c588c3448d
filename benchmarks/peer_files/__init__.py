"""canid against python-can and cantools on the files of their own test suites."""
