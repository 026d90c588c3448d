"""The page of `canid look`: every signal as a line over time, with search, several on one axis, and a cursor."""
