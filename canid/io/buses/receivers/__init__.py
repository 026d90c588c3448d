"""Receivers: SocketCAN and udp_multicast with one system call for many frames, and python-can for all others."""
