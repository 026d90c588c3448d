"""Damaged logs by the thousand: what they are made of, how they are damaged, and what must hold of every one."""
