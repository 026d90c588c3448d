"""Layer 4, models: driver and car simulated, estimated chunk by chunk, saved and diagnosed; imports layers 1 to 3."""
