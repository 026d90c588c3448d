"""Effects hidden in simulated drives, by simulators written apart from canid, and what the diagnosis makes of them."""
