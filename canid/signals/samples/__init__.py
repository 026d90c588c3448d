"""Chunks of frames → samples on a uniform grid.

In the order of a chunk's way: `session_clock`, decoding (`canid.signals.vehicle.decoding`), `lead_readings` with `lead` and
`smoothing`, `sampling_grid`, `learning_gate`; `sampler` composes them. Every step goes on from chunk to chunk, so the
samples do not depend on how the frames are divided into chunks.
"""
