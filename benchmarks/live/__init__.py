"""Latency, CPU and start-up of the live path."""
