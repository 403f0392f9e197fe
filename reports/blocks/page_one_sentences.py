"""Headline sentences of page one: how near, how it moves, at what cost, how certain, on other bodies."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics import paper_claims
from reports.statistics.body_shapes import excess_energy, rows_of_other_shapes
from reports.statistics.break_even import NETWORK, compared_scenes
from reports.statistics.means_and_spreads import pair, value_of
from reports.statistics.page_one_methods import EXTERNAL, LEARNED, leads, subjects
from reports.statistics.pareto import (
    SMALLER_STEPS,
    Point,
    beaten_by,
    fastest,
    indistinct,
    points_of,
    run_time,
    truncated,
)
from reports.statistics.published import published_beside
from reports.statistics.relative_excess import TOTAL, Excess, excess_of, with_relative_excess
from reports.statistics.verdicts import LESS, MORE, TIED, compare_methods, standing
from reports.tables.number_texts import duration, number

CURVATURE, DISTANCE, GAP = "curvature/error", "distance/rms", "gap/energy"
SWING, ALIKE, INSIDE = "dynamics/amplitude", "dynamics/correlation", "penetration/surface"


def headline(run: Run) -> list[tuple[str, str]]:
    """Return (topic, sentence) for each topic of page one that the run can tell."""
    scenes = next(iter(run.garments(run.garment_rows).values()), [])
    worn = run.garment_rows[run.garment_rows["scene"].isin(scenes)]
    cells = run.cells("speed", "garments")
    compared = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(compared)] if compared else worn
    sentences = {
        "How near": _near(run, worn) or _distances(run, cells), "How it moves": _moves(run, worn),
        "At what cost": _cost(run, timed, compared), "How certain": _trust(run, timed),
        "On other bodies": _on_other_bodies(run),
    }  # fmt: skip
    return [(topic, unbroken(sentence)) for topic, sentence in sentences.items() if sentence]


def _near(run: Run, worn: pd.DataFrame) -> str:
    """Say which share of skinning's excess energy each network of page one leaves."""
    names = [n for n in leads(run, worn, by=(TOTAL,)) if run.methods[n].role in (*LEARNED, EXTERNAL)]
    rows = with_relative_excess(run, worn)
    known = {name: excess for name in names if (excess := excess_of(run, rows, name))}
    if not known:
        return ""
    first, *others = known
    excess = known[first]
    unseen = "" if set(worn["scene"]) <= set(run.trained_on) else "unseen "
    count = len(excess.by_motion)
    motions = f"{count} {unseen}motion{'' if count == 1 else 's'}"
    text = (
        f"On {motions} {run.label(first)} has a relative excess energy of {_share(excess)}, where the "
        f"reference solver has 0 % and skinning alone 100 %: {_stands(excess)}"
    )
    beside = published_beside(run, first)
    text += f" ({beside})" if beside else ""
    text += "".join(f"; {run.label(name)} has {_share(known[name])}" for name in others)
    if count > 1:
        scene, worst = excess.worst
        low, high = (number(share, 2) for share in excess.without_each_motion)
        text += (
            f". {run.label(first)}: mean {number(excess.mean, 2)} %, worst motion {number(worst, 2)} % "
            f"({scene.partition('/')[2] or scene}), {low} to {high} % when any one motion is left out"
        )
    return f"{text}."


def _distances(run: Run, rows: pd.DataFrame) -> str:
    """Say how far the subjects are from the reference, for a run without skinning."""
    parts = []
    for method in subjects(run, set(rows[rows["usable"]]["method"])):
        distance, gap = (value_of(rows, method, name) for name in (DISTANCE, GAP))
        if distance is not None:
            above = "" if gap is None else f", with an energy gap of {number(gap)} J"
            parts.append(f"{run.label(method)} lies {number(distance)} mm from the reference{above}")
    return f"{'; '.join(parts)}." if parts else ""


def _share(excess: Excess) -> str:
    """Return a relative excess as "6.1 % (2.3 to 14)"."""
    interval = excess.effect.interval
    ends = f" ({' to '.join(number(end, 2) for end in interval)})" if interval else ""
    return f"{number(excess.typical, 2)} %{ends}"


def _stands(excess: Excess) -> str:
    """Say how the method stands to the reference."""
    stands = standing(excess.effect, excess.effect.p_value())
    words = {TIED: "a tie", MORE: "more energy than the reference", LESS: "less energy than the reference"}
    return words.get(stands, "inconclusive")


def _moves(run: Run, worn: pd.DataFrame) -> str:
    """Say what each subject lacks of the simulation's motion, and how much of it lies inside the body."""
    parts = []
    reference = value_of(worn, run.reference, INSIDE)
    for method in subjects(run, set(worn[worn["usable"]]["method"])):
        swing, alike, inside = (value_of(worn, method, name) for name in (SWING, ALIKE, INSIDE))
        if swing is not None:
            share = number(100.0 * swing, 2)
            parts.append(
                f"the hem of {run.label(method)} has {share} % of the simulation's dynamic amplitude"
            )
            parts[-1] += "" if alike is None else f", correlation {number(alike, 2)}"
        if inside is not None:
            beside = "" if reference is None else f", of the simulation {number(reference, 2)} %"
            whose = f" of {run.label(method)}" if swing is None else ""
            parts.append(f"{number(inside, 2)} % of the surface{whose} lies inside the body{beside}")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _cost(run: Run, timed: pd.DataFrame, scenes: list[str]) -> str:
    metric = run.metrics.get(run_time(timed))
    network = next(iter(subjects(run, set(timed[timed["usable"]]["method"]))), NETWORK)
    compared = compare_methods(run, timed, metric, run.reference, network) if metric else None
    if compared is None or compared.effect is None or compared.other is None or not compared.other.value:
        return ""
    ends = compared.effect.interval
    times = " to ".join(number(end, 2) for end in ends) if ends else number(compared.effect.shown, 2)
    own = number(compared.other.value)
    text = f"{run.label(network)} takes {own} ms a frame, the simulation {times} times as long"
    training = value_of(run.garment_rows, network, "cost/train")
    text += f"; training takes {duration(training)}" if training else ""
    more = _rivals(run, run.cells("speed", "garments"), scenes) if scenes else ""
    return f"{text}; {more}" if more else f"{text}."


def _trust(run: Run, timed: pd.DataFrame) -> str:
    """Say how uncertain the reference itself is, what its time step leaves out, and how claims came out."""
    parts = []
    apart = [indistinct(run, timed, metric) for metric in (CURVATURE, DISTANCE)]
    if all(apart):
        parts.append(
            f"equally valid simulations lie {number(apart[0], 2)} 1/m and {number(apart[1], 2)} mm apart, "
            "and what is nearer is inconclusive"
        )
    finest = max(_smaller_steps(run, timed), key=lambda name: run.methods[name].level or 0.0, default="")
    if finest:
        count = int(run.methods[finest].level or 0)
        strain, amplitude = (pair(timed, finest, run.reference, name) for name in ("energy/strain", SWING))
        words = [
            f"{what} is {number(one.value / other.value, 2)} times"
            for what, (one, other) in (("strain", strain), ("the hem's amplitude", amplitude))
            if one and other and other.value
        ]
        parts.append(
            "converged means that each time step of 1/30 s is minimised; with "
            f"{count} steps a frame {' and '.join(words)} as large"
        )
    counted = paper_claims.counts(run)
    if counted:
        parts.append(f"the primary claims of the paper: {paper_claims.in_words(counted)}")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if parts else ""


def _smaller_steps(run: Run, rows: pd.DataFrame) -> list[str]:
    """Return the simulations with smaller time steps among these rows."""
    have = set(rows[rows["usable"]]["method"])
    return [name for name, method in run.methods.items() if method.family == SMALLER_STEPS and name in have]


def _rivals(run: Run, frame: pd.DataFrame, scenes: Sequence[str]) -> str:
    """Say by the energy gap what beats the network, and which solver stopped early is as accurate."""
    points = points_of(run, frame, scenes, GAP)
    network = next((p for p in points if p.method == NETWORK), None)
    if network is None:
        return ""
    best, solver = beaten_by(points, network), fastest(truncated(run, points), network.error)
    text = f"by {run.metrics[GAP].title.lower()} ({_both(network)}) "
    if best is None:
        rows = frame[frame["scene"].isin(list(scenes)) & (frame["metric"] == GAP) & frame["usable"]]
        partly_measured = set(rows["method"]) - {point.method for point in points}
        text += "nothing as fast as SNUG is nearer"
        text += ", of those that have it in all scenes" if partly_measured else ""
    else:
        within = " within repeats" if best.time > network.time else ""
        apart = network.error - best.error > network.error_spread + best.error_spread
        near = "nearer" if apart else "as near, within the scatter of seeds and of right simulations,"
        text += f"{run.label(best.method)} is {near} and no slower{within} ({_both(best)})"
    text += f"; the fastest solver as near is {run.label(solver.method)}, " if solver else ""
    return text + (f"{number(solver.time)} ms." if solver else ".")


def _both(point: Point) -> str:
    return f"{number(point.error)} in {number(point.time)} ms{point.fewer}"


def _on_other_bodies(run: Run) -> str:
    """Say how much energy networks, and skinning alone, have above the simulation."""
    rows = rows_of_other_shapes(run)
    parts = []
    for name in run.ordered(set(rows["method"]) - set(run.reference_ensemble)):
        if run.methods[name].role in ("baseline", "network", "ablation"):
            above, fewer = excess_energy(run, rows, name)
            parts += [] if above is None else [f"{run.label(name)} {number(above)}{fewer}"]
    where = f"on {rows['scene'].nunique()} other bodies [J]"
    return f"Total energy above the simulation's {where}: {', '.join(parts)}." if parts else ""


def unbroken(text: str) -> str:
    """Return the text with each number on the line of its unit."""
    return re.sub(r"(?<=\d) (?=(J|ms|mm|1/m|%)\b|%)", "\u00a0", text)
