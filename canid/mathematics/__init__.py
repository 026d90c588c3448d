"""Layer 2, mathematics: identification, estimators, systems and populations, on arrays; imports layer 1."""
