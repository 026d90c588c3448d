"""CAN buses through python-can and SocketCAN: opened listen-only, read without loss; the one sender."""
