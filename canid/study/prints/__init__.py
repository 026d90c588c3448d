"""What follows from the printed numbers of the two papers alone; no log needed."""
