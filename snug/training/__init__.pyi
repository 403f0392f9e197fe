from .checkpoint import Checkpoint as Checkpoint
from .kinds import KINDS as KINDS
from .losses.vertex_targets import TargetError as TargetError
from .simulated_data import DataSet as DataSet
from .training_loop import Interrupted as Interrupted
from .training_set import TrainingError as TrainingError
from .validation import Validation as Validation

__all__ = [
    "KINDS",
    "Checkpoint",
    "DataSet",
    "Interrupted",
    "TargetError",
    "TrainingError",
    "Validation",
]
