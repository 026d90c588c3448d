"""Which logs there are, whose they are, and how each is decoded."""
