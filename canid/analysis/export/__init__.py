"""Tables of a drive (samples, estimates, signals) as files for other programs, one file here for each format."""
