"""Layer 5, io: files, buses, logs, recording and publishing; imports layers 1 to 4."""
