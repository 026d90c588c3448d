"""Drivers as vehicle types of the traffic simulator Eclipse SUMO."""
