"""Effects on the innovations of the noise that the driver adds."""
