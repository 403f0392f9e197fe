"""The plan of a run: from a request to cells, cases, motions and a user's inputs.

request: everything that a user asks for. make_plan: the plan of a request. plan: what a run will do.
options: the options of benchmarks.run. suites, choose_cells: which scenes meet which methods.
motion_split: which motions train, validate and test. user_files: methods, scenes and metrics of a user's
files. plan_roll_out: the plan of benchmarks.score. plan_scene: that of one scene alone. list_names: the text
of --list.

>>> from benchmarks.plan import Request, make_plan
>>> plan = make_plan(Request(scenes=("flag",), methods=("simulation",), suites=("speed",)))
>>> [cell.label for cell in plan.cells]
['flag x simulation']
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
