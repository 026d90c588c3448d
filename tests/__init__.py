"""Tests of canid, and the simulators that they and the benchmarks share."""
