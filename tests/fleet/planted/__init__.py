"""A planted fleet: drives of drivers that are drawn from a hidden population, in cars with hidden faults."""
