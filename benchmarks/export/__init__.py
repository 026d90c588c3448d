"""Cost of `canid export` per format, against pandas, python-can with cantools, and asammdf."""
