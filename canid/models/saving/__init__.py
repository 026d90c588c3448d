"""Saved states: what the estimators have learnt, typed, with a checksum, tied to vehicle and configuration."""
