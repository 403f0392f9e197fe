"""What the run found: a few sentences, computed from the numbers and printed as they come out."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pandas as pd

from reports import claims, tables
from reports.break_even import NETWORK, compared_scenes, cost_of, crossing, frames_text, rivals
from reports.data import Run
from reports.means import mean_of, pair, shared_scenes, value_of
from reports.numbers import duration, number, with_spread
from reports.pareto import (
    SMALLER_STEPS,
    TIME,
    WHOLE,
    Point,
    beaten_by,
    fastest,
    indistinct,
    points_of,
    truncated,
)

SHOWN = 4  # names of files
TOTAL, CURVATURE, DISTANCE = "energy/total", "curvature/error", "distance/rms"


def summary(run: Run) -> list[tuple[str, str]]:
    """(topic, sentences), of what the run holds numbers for; means are of the first garment."""
    scenes = next(iter(run.garments(run.worn).values()), [])
    worn = run.worn[run.worn["scene"].isin(scenes)]
    cells = run.cells("speed", "garments")
    compared = next(iter(compared_scenes(run, cells).values()), [])
    has_network = NETWORK in set(worn["method"])
    found = [
        ("Changed since", changed(run)),
        ("Total energy", least(run, worn, TOTAL, "J")),
        ("Wrinkles", least(run, worn, CURVATURE, "1/m")),
        ("Run time", run_time(run, worn if has_network else cells[cells["scene"].isin(compared)])),
        ("Error against time", fronts(run, cells, compared)),
        ("When training pays", training_pays(run, cells, compared)),
        ("The reference", reference(run, cells[cells["scene"].isin(compared)])),
        ("Claims of the paper", claims.counts(run)),
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


def least(run: Run, worn: pd.DataFrame, metric: str, unit: str) -> str:
    """The networks by a metric, the lowest first, and then what was not trained, over the scenes of all."""
    rows = worn[(worn["metric"] == metric) | ~worn["usable"]]
    have = set(rows[rows["usable"]]["method"])
    networks = [name for name in run.with_role("network") if name in have and not run.methods[name].base]
    others = [name for name in run.ordered(run.with_role("reference", "bound", "baseline")) if name in have]
    scenes = shared_scenes(rows, [*networks, *others], metric)
    means = {name: mean_of(rows, name, metric, scenes) for name in (*networks, *others)}
    found = {name: mean for name, mean in means.items() if mean is not None}
    order = sorted((name for name in networks if name in found), key=lambda name: found[name].value)
    if not order:
        return ""
    best = found[order[0]]
    text = (
        f"{run.label(order[0])} has {with_spread(best.value, best.spread_or_uncertainty)} {unit}{best.fewer}"
    )
    said = {name: f"{run.label(name)} {number(mean.value)}{mean.fewer}" for name, mean in found.items()}
    after, beside = (", ".join(said[name] for name in names if name in said) for names in (order[1:], others))
    text += f", {after}." if after else "."
    text += f" Beside them: {beside}." if beside else ""
    asked = worn[worn["metric"] == metric]["scene"].nunique()
    return text + (f" Over {len(scenes)} of {asked} scenes." if len(scenes) < asked else "")


def run_time(run: Run, frame: pd.DataFrame) -> str:
    own, reference = pair(frame, NETWORK, run.reference, TIME)
    if own is None or reference is None or not own.value:
        return ""
    text = f"{run.label(NETWORK)} takes {number(own.value)} ms per frame, the simulation "
    text += f"{number(reference.value)} ms: {number(reference.value / own.value, 2)} times{own.fewer}."
    whole = pair(frame, NETWORK, run.reference, WHOLE)
    if whole[0] is None or whole[1] is None:
        return text
    return f"{text} From pose to vertices {number(whole[0].value)} and {number(whole[1].value)} ms."


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
            text += "nothing as fast as SNUG is nearer"
        else:
            within = " within repeats" if best.time > own.time else ""
            apart = own.error - best.error > own.error_spread + best.error_spread
            near = "nearer" if apart else "as near, within the scatter of seeds and of right simulations,"
            text += f"{run.label(best.method)} is {near} and no slower{within} ({_both(best)})"
        text += f"; the fastest solver as near is {run.label(solver.method)}, " if solver else ""
        text += f"{number(solver.time)} ms." if solver else "."
    return text.strip()


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
