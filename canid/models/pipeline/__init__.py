"""Chunks of frames in, outputs out: the one composition for live, replay and batch, and its own time."""
