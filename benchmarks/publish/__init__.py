"""Published studies, run again at one commit: `python -m benchmarks.publish`."""
