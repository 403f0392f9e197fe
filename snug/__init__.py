"""Bodies, garments, networks and their training."""
