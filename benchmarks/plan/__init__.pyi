from .make_plan import make_plan as make_plan
from .plan import Motions as Motions
from .plan import Plan as Plan
from .plan import PlanError as PlanError
from .read_study import read_study as read_study
from .study import Study as Study
from .study import StudyError as StudyError

__all__ = ["Motions", "Plan", "PlanError", "Study", "StudyError", "make_plan", "read_study"]
