"""The vehicle's block: model, fit, search for causes."""
