"""Scenes x methods: who is how accurate, and at what cost.

Run `python -m benchmarks.run --help`. Nothing heavy is imported here.
"""
