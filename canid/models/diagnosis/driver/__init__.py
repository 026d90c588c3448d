"""The driver's block: model, fit, search for causes, detectors."""
