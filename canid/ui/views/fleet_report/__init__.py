"""The page of a fleet: many drives of many drivers."""
