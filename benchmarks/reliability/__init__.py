"""What recording promises, tried out: kills, power cuts, disks and buses that fail, hours of traffic."""
