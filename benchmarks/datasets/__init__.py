"""Data sets of simulated motions, for training on more frames than fit into memory: their building."""
