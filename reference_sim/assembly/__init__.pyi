from .cholesky import analyse as analyse
from .hessian_pattern import HessianPattern as HessianPattern

__all__ = ["HessianPattern", "analyse"]
