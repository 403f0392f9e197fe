from .roll_out_files import StoredRollOut as StoredRollOut
from .roll_out_files import read_roll_out as read_roll_out
from .roll_out_option import FileConventions as FileConventions
from .roll_out_option import RollOutFileError as RollOutFileError
from .roll_out_option import RollOutOption as RollOutOption
from .roll_out_option import parse_roll_out as parse_roll_out
from .scene_fit import fit_to_scene as fit_to_scene

__all__ = [
    "FileConventions",
    "RollOutFileError",
    "RollOutOption",
    "StoredRollOut",
    "fit_to_scene",
    "parse_roll_out",
    "read_roll_out",
]
