from .array_file import ArrayFileError as ArrayFileError
from .array_file import read_array as read_array
from .array_file import read_arrays as read_arrays
from .array_file import write_array as write_array
from .atomic_files import new_folder as new_folder
from .atomic_files import replacing as replacing
from .mesh_files import Surface as Surface
from .mesh_files import read_mesh as read_mesh
from .mesh_files import read_sequence as read_sequence
from .mesh_files import to_metres_y_up as to_metres_y_up
from .uv_chart import join_seams as join_seams
from .uv_chart import rest_chart as rest_chart

__all__ = [
    "ArrayFileError",
    "Surface",
    "join_seams",
    "new_folder",
    "read_array",
    "read_arrays",
    "read_mesh",
    "read_sequence",
    "replacing",
    "rest_chart",
    "to_metres_y_up",
    "write_array",
]
