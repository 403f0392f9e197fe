"""Processes: work that may hang or crash is done in one of its own."""
