from .closed_mesh import check_closed as check_closed
from .surface import vertex_normals as vertex_normals
from .topology import boundary_loops as boundary_loops
from .topology import corner_angles as corner_angles
from .topology import triangle_areas as triangle_areas

__all__ = ["boundary_loops", "check_closed", "corner_angles", "triangle_areas", "vertex_normals"]
