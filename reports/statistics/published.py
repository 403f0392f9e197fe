"""Whether a run of the default preset gives what was published, on the same motions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.results.protocol import LEVEL, OWN
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.run.finished_run import Run
from reports.run.reading import read_run
from reports.statistics.effects import EXCESS, off_scale, on_scale, recording_of
from reports.statistics.relative_excess import RELATIVE_EXCESS, with_relative_excess

PUBLISHED = Path(__file__).resolve().parents[1] / "published"
DEFAULT = "quick"  # the preset that is published, and the folder of its run


def published_beside(run: Run, method: str) -> str:
    """Return "published 6.8 % on these motions: reproduced", empty for a run that has nothing beside it.

    It has where its preset is the default, its motions have the published frames (`--frames` cuts them), and
    the checkout has the published run. Segments of a recording count as one motion, as in the typical
    relative excess. A method is reproduced where the mean of its m seeds, on the scale of relative excess,
    lies within the interval in which that of m more seeds is expected: the mean of the n published ones, plus
    or minus Student's t times their standard deviation times sqrt(1/m + 1/n).
    """
    if run.config.get("preset") != DEFAULT or not (PUBLISHED / DEFAULT).is_dir():
        return ""
    try:
        published = read_published(PUBLISHED / DEFAULT)
    except ResultsError:
        return ""  # of an earlier version
    if published.config.get("started") == run.config.get("started"):
        return ""  # the published run itself, or another that is made to be published
    if published.protocol != run.protocol:
        return ""
    ours, theirs = _by_seed(run, method), _by_seed(published, method)
    scenes = sorted(set(ours.index) & set(theirs.index))
    if _frames(run, scenes) != _frames(published, scenes):
        return ""
    if not scenes or set(ours.index) - set(scenes):
        return ""
    before, now = (
        values.loc[scenes].groupby(recording_of).mean().mean().to_numpy() for values in (theirs, ours)
    )
    text = f"published {float(off_scale(before.mean(), EXCESS)):.2g} % on these motions"
    if len(before) < 2:
        return text
    reach = stats.t.ppf(1.0 - LEVEL / 2.0, len(before) - 1) * before.std(ddof=1)
    reach *= math.sqrt(1.0 / len(now) + 1.0 / len(before))
    return f"{text}: {'reproduced' if abs(now.mean() - before.mean()) <= reach else 'not reproduced'}"


@cache
def read_published(folder: Path) -> Run:
    """Return a published run, read once. Raises ResultsError for a run of an earlier version."""
    return read_run(RunFolder(folder))


def _frames(run: Run, scenes: Sequence[str]) -> list[int | None]:
    """Return the number of frames of each scene's motion, None where the run does not say."""
    frames, declared = run.config.get("motions", {}).get("frames", {}), run.config.get("scenes", {})
    return [frames.get(declared.get(scene, {}).get("motion")) for scene in scenes]


def _by_seed(run: Run, method: str) -> pd.DataFrame:
    """Return scene x seed -> relative excess of a method of the first garment, on its scale.

    Rows of a user's own scenes or settings, as of self-contact, are left out.
    """
    rows = run.garment_rows
    rows = with_relative_excess(run, rows[rows["garment"] == run.first_garment])
    rows = rows[rows["usable"] & (rows["protocol"] != OWN)]
    kept = rows[(rows["metric"] == RELATIVE_EXCESS.name) & (rows["method"] == method)]
    shares = kept.pivot_table(index="scene", columns="seed", values="value")
    return shares.apply(lambda column: np.asarray(on_scale(column.to_numpy(), EXCESS))).dropna()
