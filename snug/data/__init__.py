"""Data of the package: the human body, and its notice."""
