"""Minimisers that the comparison alone needs: same call and same result as those of reference_sim."""
