"""Start-up, latency and CPU of the live page, and its screenshots."""
