"""Protocol: which rows are of it. Its number and digests are in benchmarks.results.protocol."""
