"""The files of a run: the only thing that a report knows of a benchmark.

row: a line of results.csv. run_config: run.json. run_folder: where each file lies. frame_energies: energies
of single frames. json_file: JSON that a stranger may have changed.

>>> from benchmarks.results import Row
>>> Row("speed", "flag", "newton-1", 0, "energy/total", "J", value=-0.5).passed
True
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
