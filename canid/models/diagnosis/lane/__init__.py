"""Diagnosis of lane keeping: the driver steers by the lateral offset."""
