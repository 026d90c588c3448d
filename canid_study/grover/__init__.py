"""Grover 2021 on any log: episodes, transfer functions per input, their reduction, and the joint fit next to them."""
