"""`canid fleet`: a planted fleet scored against its truth, cost and scale, and the measured drives."""
