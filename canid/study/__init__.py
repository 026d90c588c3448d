"""The two papers behind canid: what follows from their numbers, their method on any log, and canid's answer next to it."""
