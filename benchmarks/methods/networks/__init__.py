"""Methods that need a body: networks, skinning, post-processing, vertices optimised directly."""
