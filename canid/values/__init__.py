"""Values that every part may use: frames, samples, estimates, findings, times, errors, and their text."""
