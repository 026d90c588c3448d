"""Reading and decoding logs, against python-can with cantools and others: frames per CPU-second on the same file."""
