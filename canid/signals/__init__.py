"""Layer 3, signals: from DBC and vehicle files and frames to samples, their checks and triggers; imports layers 1 and 2."""
