"""CPU and losses of `canid record`, against python-can's logger."""
