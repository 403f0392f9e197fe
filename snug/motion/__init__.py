"""Motions: joint rotations over time, the embedded library, files of motion capture.

| module | what lies there |
| --- | --- |
| motion | `Motion`, and operations on one: resample, place, mirror, spread arms |
| library | the motions of the package by name and role; `make_motion` |
| clips | tables of angles that the motions made by code consist of |
| recorded | recorded clips of the library, under their own notice |
| files | `load_motions`: a user's files, checked and ready to use; the table of readers |
| acclaim, bvh, smpl_arrays | readers, one per format |
| joint_names, retarget | a foreign skeleton: its joints matched with ours, its motion put on ours |
| options | facts that a file does not state, such as its vertical axis |
| raw_motion | a motion as its file has it |
| vertical_axis, recording_errors | which axis is up; jumps and numbers that are not finite |

>>> from snug.motion import LIBRARY, make_motion
>>> len(LIBRARY)
99
>>> kick = make_motion("kick")
>>> kick.poses.shape, kick.fps
((78, 24, 3), 30.0)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
