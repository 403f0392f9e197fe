"""Methods that solve the time step: the reference, its variants, stopped solvers, warm starts."""
