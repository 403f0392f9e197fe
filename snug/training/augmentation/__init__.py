"""Augmented training data: clips made from the limbs and pieces of original motions."""
