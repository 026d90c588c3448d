"""Masks: stretches without a person who drives, or without valid inputs."""
