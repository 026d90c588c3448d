"""Child processes of canid: their start and end, their limits and rights, and the messages between them and their parent."""
