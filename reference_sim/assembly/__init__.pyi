from .cholesky import LinearSolver as LinearSolver
from .cholesky import analyse as analyse
from .hessian_pattern import HessianPattern as HessianPattern

__all__ = ["HessianPattern", "LinearSolver", "analyse"]
