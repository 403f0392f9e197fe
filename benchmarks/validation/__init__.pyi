from .case import Case as Case
from .case import Measurement as Measurement
from .case import known_answer as known_answer
from .convergence import fitted_order as fitted_order
from .registry import CASES as CASES
from .registry import KNOWN_ANSWERS as KNOWN_ANSWERS
from .registry import STRESS_TESTS as STRESS_TESTS

__all__ = [
    "CASES",
    "KNOWN_ANSWERS",
    "STRESS_TESTS",
    "Case",
    "Measurement",
    "fitted_order",
    "known_answer",
]
