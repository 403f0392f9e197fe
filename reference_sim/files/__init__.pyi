from .array_file import ArrayFileError as ArrayFileError
from .array_file import read_array as read_array
from .array_file import read_arrays as read_arrays
from .array_file import write_array as write_array
from .mesh_files import Surface as Surface
from .mesh_files import read_mesh as read_mesh
from .mesh_files import read_sequence as read_sequence
from .mesh_files import to_metres_y_up as to_metres_y_up

__all__ = [
    "ArrayFileError",
    "Surface",
    "read_array",
    "read_arrays",
    "read_mesh",
    "read_sequence",
    "to_metres_y_up",
    "write_array",
]
