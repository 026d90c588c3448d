"""Transfer functions of driver and vehicle: poles, margins, reduction and string stability, by python-control."""
