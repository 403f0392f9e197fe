from .lbfgs import LBFGS as LBFGS
from .methods import MINIMISERS as MINIMISERS
from .methods import Minimiser as Minimiser
from .methods import make_minimiser as make_minimiser
from .methods import minimise as minimise
from .newton import Newton as Newton
from .result import STATUSES as STATUSES
from .result import Result as Result

__all__ = ["LBFGS", "MINIMISERS", "STATUSES", "Minimiser", "Newton", "Result", "make_minimiser", "minimise"]
