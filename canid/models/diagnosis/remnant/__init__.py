"""Law of the driver's remnant: heavy tails, a scale that follows the state, clusters."""
