"""The result files of a run."""
