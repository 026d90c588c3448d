"""What the simulation gets wrong, why, and what a better model gains."""
