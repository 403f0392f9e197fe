"""Known answers of contact, friction and time steps."""
