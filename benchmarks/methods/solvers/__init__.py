"""Methods that minimise: the reference and solvers stopped early."""
