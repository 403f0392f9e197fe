"""The human body: skeleton, parametric body, skinning, and files of SMPL's family.

| module | what lies there |
| --- | --- |
| skeleton | names, parents and rest positions of the 24 joints; rotations and forward kinematics |
| parametric_body | `Body`: template, shape directions, joints, skinning weights; posed vertices |
| skinning | linear blend skinning in torch, and its inverse |
| smpl_files | `read_body`: a user's SMPL, SMPL-H, SMPL-X or plain arrays, checked |
| t_pose | a body in A pose, brought to the T pose |

>>> from snug.body import Body, JOINT_NAMES
>>> body = Body.load()
>>> body.template.shape, len(JOINT_NAMES), body.shape_count
((13348, 3), 24, 10)
>>> import numpy as np
>>> standing = body.vertices(np.zeros((1, 24, 3)), np.zeros((1, 3)))
>>> bool(abs(standing[0] - body.template).max() < 1e-12)
True
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
