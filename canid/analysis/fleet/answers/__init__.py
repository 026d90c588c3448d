"""What a fleet says: the population, questions to it, causes, data quality, what to drive next."""
