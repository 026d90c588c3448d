"""Statistics of many drives and drivers: partial pooling, changes over weeks, groups, false discovery rate."""
