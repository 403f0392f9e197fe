"""Data sets of simulated motions: how they are built, and how several are joined."""
