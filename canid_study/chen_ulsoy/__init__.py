"""Lane keeping as in Chen & Ulsoy 2001: their segments, models and uncertainties on any log, and canid's next to them."""
