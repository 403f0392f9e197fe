"""Repeatability of GAUGE's textile experiments, from the trials of a user's copy."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.fabrics.gauge import GaugeFileError, read_tasks, read_trial, trial_files, version
from benchmarks.fabrics.markers import deviations


def repeatability(folder: str, task: str, fabric: str, digest: str) -> float:
    """Return the mean deviation of the trials from their mean [degrees]. Raises GaugeFileError."""
    return float(np.degrees(_deviations(folder, task, fabric, digest).mean()))


def spread(folder: str, task: str, fabric: str, digest: str) -> float:
    """Return the standard deviation of these deviations over the trials [degrees]. Raises GaugeFileError."""
    return float(np.degrees(_deviations(folder, task, fabric, digest).std()))


@cache
def _deviations(folder: str, task: str, fabric: str, digest: str) -> np.ndarray:
    """Return the deviation (N,) [rad] of each trial; the digest names the files that are meant."""
    root = Path(folder)
    if version(root, task, fabric) != digest:
        raise GaugeFileError(f"--gauge {folder}: files of {task}, {fabric} changed since the run was planned")
    (declared,) = (found for found in read_tasks(root) if found.name == task)
    trials = [read_trial(path, declared) for path in trial_files(root, task, fabric)]
    return deviations([declared.markers.curvature(x) for x in trials])
