"""Search for contact: closest faces of a moving mesh, and pairs of primitives that are close."""
