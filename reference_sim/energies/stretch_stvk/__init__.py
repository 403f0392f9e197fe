"""StVK membrane: its definition with kernels in float64, and its kernels for solvers and training."""
