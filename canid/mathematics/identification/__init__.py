"""The mathematics on arrays: one method per file, no state, no clock, no input or output."""
