"""Changes from one run to another that exceed the noise of both."""
