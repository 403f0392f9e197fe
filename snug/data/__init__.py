"""Data of the package: the baked body, see `snug.body.bake`, and its licence."""
