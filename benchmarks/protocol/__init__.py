"""Protocol: what its digests hold, and which rows are of it. Its number is in benchmarks.results.protocol."""
