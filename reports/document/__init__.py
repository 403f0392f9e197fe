"""The PDF of a run: report blocks laid out by a typesetter."""
