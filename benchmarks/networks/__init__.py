"""The command python -m benchmarks.networks: trainings of a run without its measurements."""
