"""The command python -m benchmarks.submit: entries of other people, checked and scored from their vertices.

>>> from benchmarks.submit.entry import SCENES
>>> len(SCENES)
8
"""
