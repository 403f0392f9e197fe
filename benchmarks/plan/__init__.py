"""The plan of a run: from a study to cells, cases, motions and a user's inputs.

study: what is asked. read_study: from its file and options. make_plan: the plan of a study. plan: what a run
will do. options: those of benchmarks.run. choose_cells: which scenes meet which methods. motion_split: which
motions train, validate and test. user_files: methods, scenes and metrics of a user's files. list_names: the
text of --list.

>>> from benchmarks.plan import make_plan, read_study
>>> [cell.label for cell in make_plan(read_study("engines")).cells]
[]
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
