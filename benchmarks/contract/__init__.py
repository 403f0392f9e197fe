"""What a method, a scene and a metric have to keep, looked at on tiny scenes. See benchmarks.check."""
