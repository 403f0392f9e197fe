"""A finished run as its folder holds it: rows, declarations, stored roll-outs, histories of trainings.

`reading` is the one module that opens files of a run; `finished_run` says what they hold.
"""
