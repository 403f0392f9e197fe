from .files import load_motions as load_motions
from .library import LIBRARY as LIBRARY
from .library import TEST as TEST
from .library import TRAIN as TRAIN
from .library import VALIDATION as VALIDATION
from .library import make_motion as make_motion
from .motion import Motion as Motion
from .motion import MotionError as MotionError
from .motion import mirror_motion as mirror_motion
from .motion import place as place
from .motion import resample as resample
from .motion import spread_arms as spread_arms
from .motion import transition as transition
from .options import MotionFileOptions as MotionFileOptions

__all__ = [
    "LIBRARY",
    "TEST",
    "TRAIN",
    "VALIDATION",
    "Motion",
    "MotionError",
    "MotionFileOptions",
    "load_motions",
    "make_motion",
    "mirror_motion",
    "place",
    "resample",
    "spread_arms",
    "transition",
]
