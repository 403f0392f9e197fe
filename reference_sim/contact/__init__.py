"""Search for contact: closest faces of a moving mesh, pairs of primitives that are close."""
