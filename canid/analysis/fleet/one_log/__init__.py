"""The analysis of one log: from its bytes to the rows of the fleet's tables."""
