from .lbfgs import LBFGS as LBFGS
from .minimisers import MINIMISERS as MINIMISERS
from .minimisers import Minimiser as Minimiser
from .minimisers import make_minimiser as make_minimiser
from .minimisers import minimise as minimise
from .newton import Newton as Newton
from .result import STATUSES as STATUSES
from .result import Result as Result

__all__ = ["LBFGS", "MINIMISERS", "STATUSES", "Minimiser", "Newton", "Result", "make_minimiser", "minimise"]
