"""Statistics of textile tests: errors of solvers, and fabrics that they put in the wrong order."""
