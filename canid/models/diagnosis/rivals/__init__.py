"""Published car-following models, calibrated and judged in closed loop on the same drive as canid's own."""
