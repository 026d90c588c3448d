"""Layer 1, values: what flows through canid, as types and as text, its errors and child processes; imports no layer."""
