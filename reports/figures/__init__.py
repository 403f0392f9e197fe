"""Figures of a run, each a function that a Figure of reports.blocks.BLOCKS names."""
