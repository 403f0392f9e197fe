"""What changed from one run to another beyond the noise of both."""
