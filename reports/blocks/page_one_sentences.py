"""Headline sentences of page one: how near, at what cost, how certain, on other bodies."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics import paper_claims
from reports.statistics.body_shapes import excess_energy, rows_of_other_shapes
from reports.statistics.break_even import NETWORK, compared_scenes
from reports.statistics.means_and_spreads import Mean, mean_of, pair, shared_scenes, value_of
from reports.statistics.page_one_methods import LEARNED, leads
from reports.statistics.pareto import Point, beaten_by, fastest, indistinct, points_of, run_time, truncated
from reports.statistics.significance import OPEN, TIED, effect_on, standing
from reports.tables.number_texts import number, with_spread

TOTAL, CURVATURE, DISTANCE, SWING = "energy/total", "curvature/error", "distance/rms", "dynamics/amplitude"
GAP = "gap/energy"


def headline(run: Run) -> list[tuple[str, str]]:
    """Say (topic, sentence) how near, at what cost, how certain, and what on other bodies, where known."""
    scenes = next(iter(run.garments(run.garment_rows).values()), [])
    worn = run.garment_rows[run.garment_rows["scene"].isin(scenes)]
    cells = run.cells("speed", "garments")
    compared = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(compared)] if compared else worn
    sentences = {
        "How near": _near(run, worn), "At what cost": _cost(run, timed, compared),
        "How certain": _trust(run, worn, timed), "On other bodies": _on_other_bodies(run),
    }  # fmt: skip
    return [(topic, unbroken(sentence)) for topic, sentence in sentences.items() if sentence]


def _near(run: Run, worn: pd.DataFrame) -> str:
    """Compare the network's total energy with the simulation's, over scenes that all of page one have."""
    rows = worn[(worn["metric"] == TOTAL) | ~worn["usable"]]
    have = set(rows[rows["usable"]]["method"])
    names = [name for name in leads(run, worn, by=(TOTAL,)) if name in have]
    scenes = shared_scenes(rows, names, TOTAL)
    all_means = {name: mean_of(rows, name, TOTAL, scenes) for name in names}
    means = {name: mean for name, mean in all_means.items() if mean is not None}
    network = next((name for name in means if run.methods[name].role in LEARNED), "")
    if not network or run.reference not in means:
        return ""
    one, other = means.pop(network), means.pop(run.reference)
    asked = worn[worn["metric"] == TOTAL]["scene"].nunique()
    count = f"{len(scenes)} of {asked}" if len(scenes) < asked else str(asked)
    kind = "training" if set(worn["scene"]) <= set(run.trained_on) else "unseen"
    garments = list(run.garments(run.garment_rows))
    where = f" in {garments[0]}" if len(garments) > 1 else ""
    text = (
        f"On {count} {kind} motion{'' if asked == 1 else 's'}{where} {run.label(network)}'s total energy is "
    )
    text += f"{with_spread(one.value, one.spread_or_uncertainty)} J{one.fewer}, the simulation's "
    text += with_spread(other.value, other.spread_or_uncertainty) + _apart(run, rows, one, other)
    others = [f"{run.label(name)} has {number(mean.value)}{mean.fewer}" for name, mean in means.items()]
    return text + (f"; {', '.join(others)}." if others else ".")


def _apart(run: Run, rows: pd.DataFrame, one: Mean, other: Mean) -> str:
    """Say which way, in how many roll-outs, and whether that is inconclusive. The other has no seeds."""
    far = effect_on(run.metrics[TOTAL], one, other, run, rows)
    stands = standing(one, other, far, far.p_value())
    if stands == TIED:
        return ": a tie"
    higher, of_other = one.value > other.value, {scene: value for (scene, _), value in other.cells.items()}
    above = [(value > of_other[scene]) is higher for (scene, _), value in one.cells.items()]
    text = f": {'higher' if higher else 'lower'} in {sum(above)} of {len(above)} roll-outs"
    if far.one_seed:
        return f"{text} of one seed, which judges no network"
    return f"{text}; of other motions and seeds it cannot be told" if stands == OPEN else text


def _cost(run: Run, timed: pd.DataFrame, scenes: list[str]) -> str:
    network, reference = pair(timed, NETWORK, run.reference, run_time(timed))
    if network is None or reference is None or not network.value:
        return ""
    text = f"{run.label(NETWORK)} takes {number(network.value)} ms a frame, the simulation "
    ratio = number(reference.value / network.value, 2)
    text += f"{number(reference.value)}: {ratio} times as long{network.fewer}"
    more = _rivals(run, run.cells("speed", "garments"), scenes) if scenes else ""
    return f"{text}; {more}" if more else f"{text}."


def _trust(run: Run, worn: pd.DataFrame, timed: pd.DataFrame) -> str:
    """Say what the network lacks, and how uncertain the reference itself is."""
    parts = []
    swing = value_of(worn, NETWORK, SWING)
    if swing is not None:
        parts.append(f"the hem's own motion is {number(swing, 2)} of the simulation's")
    apart = [indistinct(run, timed, metric) for metric in (CURVATURE, DISTANCE)]
    if all(apart):
        parts.append(
            f"right simulations lie up to {number(apart[0])} 1/m and {number(apart[1])} mm apart, and what "
            "is nearer cannot be told"
        )
    counted = paper_claims.counts(run)
    if counted:
        parts.append(f"of the paper's claims tested here: {paper_claims.in_words(counted)}")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if parts else ""


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
