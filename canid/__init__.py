"""canid records a CAN bus without loss and tells how the driver is driving."""

__version__ = "0.1.0"
