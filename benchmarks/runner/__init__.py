"""Carrying out a plan: which tasks in which order, each once, and the files that the run leaves.

`execute_plan` is a whole run and `schedule` its tasks in order; `loop` reuses or runs each through an
executor; `cache` knows which results are finished or stale; `rows` and `run_json` write what came out.
"""
