"""Effects in the sensors, seen by two signals that must agree."""
