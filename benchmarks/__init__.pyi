from .declarations import DeclarationError as DeclarationError
from .method import Method as Method
from .method import MethodEntry as MethodEntry
from .method import Training as Training
from .methods.outside import program as program
from .metric import Estimate as Estimate
from .metric import Metric as Metric
from .metric import RollOut as RollOut
from .scene import BuiltScene as BuiltScene
from .scene import Scene as Scene
from .validation.case import Measurement as Measurement
from .validation.case import known_answer as known_answer

__all__ = [
    "BuiltScene",
    "DeclarationError",
    "Estimate",
    "Measurement",
    "Method",
    "MethodEntry",
    "Metric",
    "RollOut",
    "Scene",
    "Training",
    "known_answer",
    "program",
]
