"""The published runs, made again at one commit: `python -m benchmarks.publish`."""
