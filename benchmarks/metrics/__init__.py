"""What is measured of a trajectory. Curvature, distance and penetration know no energy."""
