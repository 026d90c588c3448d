"""The car-following loop of driver and car: the car's response, stability margins and string stability, with intervals."""
