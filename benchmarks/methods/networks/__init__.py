"""Methods that roll out a network, or need a body."""
