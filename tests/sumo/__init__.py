"""Drivers as vehicle types of SUMO."""
