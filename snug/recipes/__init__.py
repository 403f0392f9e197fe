"""Recipes: every choice of a training in one frozen place."""
