"""Both papers: what was published, what follows, what canid says instead."""
