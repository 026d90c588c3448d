"""First order plus dead time (FOPDT): basis, rows, fit and posterior."""
