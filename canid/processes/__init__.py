"""Child processes of canid: their start and end, their limits, and the messages between them and their parent."""
