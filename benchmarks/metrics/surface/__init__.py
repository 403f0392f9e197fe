"""Metrics of a surface, from positions alone: curvature/*, distance/*, penetration/*, shape, body."""
