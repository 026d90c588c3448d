"""What `canid export` reads and writes."""
