"""Figures of a run, each a function in a file of its own that a Figure of reports.blocks.BLOCKS names."""
