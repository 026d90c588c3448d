"""What a driver without the cause gives by his noise and the loop alone: parametric bootstrap (Efron & Tibshirani 1993)."""
