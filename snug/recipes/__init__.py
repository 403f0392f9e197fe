"""Recipes: every option of a training in one frozen place."""
