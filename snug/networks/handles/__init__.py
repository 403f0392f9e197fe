"""Handles: a few affine transforms, spread over a garment by smooth weights, in place of its vertices."""
