"""Tables of a run: PDF, CSV, LaTeX."""
