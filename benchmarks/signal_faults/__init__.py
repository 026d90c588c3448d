"""Signal checks: planted faults caught and named, and false alarms on clean and on measured drives."""
