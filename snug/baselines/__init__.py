"""Methods that SNUG is compared with, each with its own network or its own loss."""
