"""What the run found: a few sentences, computed from the numbers and printed as they come out."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pandas as pd

from reports.figures.break_even import NETWORK, compared_scenes, cost_of, crossing, frames_text, rivals
from reports.run.rows import Run
from reports.statistics import claims
from reports.statistics.means import value_of
from reports.statistics.pareto import (
    SMALLER_STEPS,
    Point,
    beaten_by,
    fastest,
    indistinct,
    points_of,
    truncated,
)
from reports.tables import tables
from reports.tables.numbers import duration, number

SHOWN = 4  # names of files
CURVATURE, DISTANCE = "curvature/error", "distance/rms"


def summary(run: Run) -> list[tuple[str, str]]:
    """(topic, sentences), of what the run holds numbers for."""
    cells = run.cells("speed", "garments")
    compared = next(iter(compared_scenes(run, cells).values()), [])
    found = [
        ("Error against time", fronts(run, cells, compared)),
        ("When training pays", training_pays(run, cells, compared)),
        ("The reference", reference(run, cells[cells["scene"].isin(compared)])),
        ("Claims of the paper", _of_claims(run)),
        ("Known answers", checks(run).strip()),
    ]
    return [(topic, unbroken(said)) for topic, said in found if said]


def unbroken(text: str) -> str:
    """A number keeps its unit on its line."""
    return re.sub(r"(?<=\d) (?=(J|ms|mm|1/m|%)\b|%)", "\u00a0", text)


def changed(run: Run) -> str:
    """That files are not what the run wrote: who reads the numbers is to know it first."""
    if not run.changed:
        return ""
    more = f" and {len(run.changed) - SHOWN} more" if len(run.changed) > SHOWN else ""
    return f"Not as the run wrote them: {', '.join(run.changed[:SHOWN])}{more}. What is said here is of them."


def fronts(run: Run, frame: pd.DataFrame, scenes: Sequence[str], first_only: bool = False) -> str:
    """By each error, what beats the network, and the fastest truncated solver that is as accurate."""
    text = ""
    for metric in ("gap/energy",) if first_only else ("gap/energy", CURVATURE):
        points = points_of(run, frame, scenes, metric)
        own = next((p for p in points if p.method == NETWORK), None)
        if own is None:
            continue
        best, solver = beaten_by(points, own), fastest(truncated(run, points), own.error)
        text += f" By {run.metrics[metric].title.lower()} ({_both(own)}) "
        if best is None:
            text += "nothing as fast as SNUG is nearer" + _of_all(frame, scenes, metric, points)
        else:
            within = " within repeats" if best.time > own.time else ""
            apart = own.error - best.error > own.error_spread + best.error_spread
            near = "nearer" if apart else "as near, within the scatter of seeds and of right simulations,"
            text += f"{run.label(best.method)} is {near} and no slower{within} ({_both(best)})"
        text += f"; the fastest solver as near is {run.label(solver.method)}, " if solver else ""
        text += f"{number(solver.time)} ms." if solver else "."
    return text.strip()


def _of_all(frame: pd.DataFrame, scenes: Sequence[str], metric: str, points: Sequence[Point]) -> str:
    """That some method has the number in a part of the scenes alone, and was not looked at."""
    rows = frame[frame["scene"].isin(list(scenes)) & (frame["metric"] == metric) & frame["usable"]]
    left_out = set(rows["method"]) - {point.method for point in points}
    return ", of those that have it in all scenes" if left_out else ""


def _both(point: Point) -> str:
    return f"{number(point.error)} in {number(point.time)} ms{point.fewer}"


def training_pays(run: Run, frame: pd.DataFrame, scenes: Sequence[str]) -> str:
    own = cost_of(frame, NETWORK, scenes)
    if own is None or own.before <= 0.0:
        return ""
    parts = []
    for method in rivals(run, frame, scenes):
        rival = cost_of(frame, method, scenes)
        frames = crossing(own, rival) if rival else None
        after = "never" if frames is None else f"after {frames_text(frames)} frames"
        parts.append(f"{after} against {run.label(method)}")
    if not parts:
        return ""
    return f"SNUG's {duration(own.before)} of training pay {', '.join(parts)}."


def reference(run: Run, frame: pd.DataFrame) -> str:
    """How far other right simulations are from it, and that of the smallest time step."""
    apart = [indistinct(run, frame, metric) for metric in (CURVATURE, DISTANCE)]
    if not all(apart):
        return ""
    text = f"Simulations as right as it lie up to {number(apart[0])} 1/m and {number(apart[1])} mm from it: "
    text += "what is nearer cannot be told from it."
    steps = [m for m in run.methods.values() if m.family == SMALLER_STEPS and m.level]
    finest = max(steps, key=lambda m: m.level or 0.0, default=None)
    found = [value_of(frame, finest.name, metric) for metric in (CURVATURE, DISTANCE)] if finest else []
    if finest is None or not all(value and value > least for value, least in zip(found, apart)):
        return text
    text += f" It is not converged in time: with {finest.level:g} steps a frame it is itself "
    return text + f"{number(found[0])} 1/m and {number(found[1])} mm away."


def _of_claims(run: Run) -> str:
    found = claims.counts(run)
    return f"Of {found.total()}: {claims.in_words(found)}." if found else ""


def checks(run: Run) -> str:
    """How many checks passed and stress tests converged, and what the others did."""
    rows = tables.checks(run)
    rows = rows[rows["tolerance"].notna() | (rows["status"] != "ok")]
    bad = [tables.check_name(run, row) for row in rows[rows["status"] != "ok"].itertuples()]
    failed = f"; failed: {', '.join(bad)}" if bad else ""
    text = f"{len(rows) - len(bad)} of {len(rows)} checks pass{failed}. " if len(rows) else ""
    tests = tables.stress_tests(run)["status"]
    others = f"; {counts(tests)}" if (tests != "ok").any() else ""
    return text + (
        f"{(tests == 'ok').sum()} of {len(tests)} stress tests converged{others}." if len(tests) else ""
    )


def counts(statuses: pd.Series) -> str:
    """As "8 stalled, 2 diverged"."""
    others = statuses[statuses != "ok"].value_counts()
    return ", ".join(f"{count} {status}" for status, count in others.items())
