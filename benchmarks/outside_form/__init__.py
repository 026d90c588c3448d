"""Estimates in a world that shares no code and no form with canid's simulators."""
