"""Metrics of energy: energy/*, excess/*, gap/*, step/* and gradient/norm."""
