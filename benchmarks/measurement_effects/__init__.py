"""What a sensor does to a measurement, at several strengths: what becomes of the quoted intervals."""
