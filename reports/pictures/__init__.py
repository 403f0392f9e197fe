"""Pictures of garments."""
