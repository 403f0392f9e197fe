"""Trajectories: positions over time, their file, and how a run is written, resumed and exported."""
