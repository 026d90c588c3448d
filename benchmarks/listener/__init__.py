"""Cost of `canid.Listener` per frame, next to that of python-can's own listeners."""
