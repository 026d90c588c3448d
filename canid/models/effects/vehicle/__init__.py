"""Effects in the vehicle, from pedal to speed."""
