"""Results of two checkouts on the same drives: what a change of structure must not change."""
