from .make_plan import make_plan as make_plan
from .plan import Motions as Motions
from .plan import Plan as Plan
from .plan import PlanError as PlanError
from .request import Request as Request

__all__ = ["Motions", "Plan", "PlanError", "Request", "make_plan"]
