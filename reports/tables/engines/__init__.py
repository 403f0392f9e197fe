"""Tables of suite engines: laws that each engine violates, and its cost at its own limit."""
