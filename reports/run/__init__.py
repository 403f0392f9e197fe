"""A finished run as a report reads it."""
