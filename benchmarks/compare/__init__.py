"""How often `canid compare` is wrong about simulated drivers, and which differences it finds."""
