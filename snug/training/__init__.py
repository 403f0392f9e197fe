"""Training of garment networks."""
