"""Roll-outs and scenes of other programs.

roll_out_option: a roll-out named on the command line. roll_out_files: its file, read. scene_fit: whether it
belongs to a scene; vertex_correspondence: in which order of vertices. exported_scene: a scene written for
another program; scene_files: each of its files.

>>> from benchmarks.external import parse_roll_out
>>> parse_roll_out("mine=out.npz,units=cm")
('mine', {'path': 'out.npz', 'units': 'cm'})
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
