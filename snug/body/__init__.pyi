from .parametric_body import Body as Body
from .skeleton import JOINT as JOINT
from .skeleton import JOINT_NAMES as JOINT_NAMES
from .skeleton import PARENTS as PARENTS
from .skeleton import REST_JOINTS as REST_JOINTS
from .skeleton import BodyError as BodyError
from .skeleton import axis_angles as axis_angles
from .skeleton import joint_positions as joint_positions
from .skeleton import rotation_matrices as rotation_matrices
from .skinning import joint_transforms as joint_transforms
from .skinning import skin as skin
from .smpl_files import read_body as read_body

__all__ = [
    "JOINT",
    "JOINT_NAMES",
    "PARENTS",
    "REST_JOINTS",
    "Body",
    "BodyError",
    "axis_angles",
    "joint_positions",
    "joint_transforms",
    "read_body",
    "rotation_matrices",
    "skin",
]
