"""What page one says in words: three sentences, what went wrong, and the worst by name."""

from __future__ import annotations

import pandas as pd

from reports.document.narrative import fronts, unbroken
from reports.figures.break_even import NETWORK, compared_scenes
from reports.figures.shapes import on_other_bodies
from reports.run.rows import Run
from reports.statistics import claims
from reports.statistics.means import Mean, mean_of, pair, shared_scenes, value_of
from reports.statistics.pareto import indistinct, run_time
from reports.statistics.significance import OPEN, TIED, effect_on, standing
from reports.tables import tables
from reports.tables.numbers import number, with_spread
from reports.tables.overview import LEARNED, leads
from reports.tables.tables import BAD

TOTAL, CURVATURE, DISTANCE, SWING = "energy/total", "curvature/error", "distance/rms", "dynamics/amplitude"
STRAIN = {"motion/strain": "strain of its worst frame", "energy/strain": "mean strain"}
MOST = 5  # of failures said on page one


def verdict(run: Run) -> list[tuple[str, str]]:
    """(topic, sentence) on how near, at what cost, how certain, other bodies: where the run has numbers."""
    scenes = next(iter(run.garments(run.worn).values()), [])
    worn = run.worn[run.worn["scene"].isin(scenes)]
    cells = run.cells("speed", "garments")
    compared = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(compared)] if compared else worn
    said = {
        "How near": _near(run, worn), "At what cost": _cost(run, timed, compared),
        "How certain": _trust(run, worn, timed), "On other bodies": on_other_bodies(run),
    }  # fmt: skip
    return [(topic, unbroken(sentence)) for topic, sentence in said.items() if sentence]


def _near(run: Run, worn: pd.DataFrame) -> str:
    """The network's total energy beside the simulation's, over the scenes that all of page one have."""
    rows = worn[(worn["metric"] == TOTAL) | ~worn["usable"]]
    have = set(rows[rows["usable"]]["method"])
    names = [name for name in leads(run, worn, by=(TOTAL,)) if name in have]
    scenes = shared_scenes(rows, names, TOTAL)
    found = {name: mean_of(rows, name, TOTAL, scenes) for name in names}
    means = {name: mean for name, mean in found.items() if mean is not None}
    own = next((name for name in means if run.methods[name].role in LEARNED), "")
    if not own or run.reference not in means:
        return ""
    one, other = means.pop(own), means.pop(run.reference)
    asked = worn[worn["metric"] == TOTAL]["scene"].nunique()
    count = f"{len(scenes)} of {asked}" if len(scenes) < asked else str(asked)
    kind = "training" if set(worn["scene"]) <= set(run.trained_on) else "unseen"
    garments = list(run.garments(run.worn))
    where = f" in {garments[0]}" if len(garments) > 1 else ""
    text = f"On {count} {kind} motion{'' if asked == 1 else 's'}{where} {run.label(own)}'s total energy is "
    text += f"{with_spread(one.value, one.spread_or_uncertainty)} J{one.fewer}, the simulation's "
    text += with_spread(other.value, other.spread_or_uncertainty) + _apart(run, rows, one, other)
    words = [f"{run.label(name)} has {number(mean.value)}{mean.fewer}" for name, mean in means.items()]
    return text + (f"; {', '.join(words)}." if words else ".")


def _apart(run: Run, rows: pd.DataFrame, one: Mean, other: Mean) -> str:
    """Which way, in how many roll-outs, and whether others may show the contrary. The other has no seeds."""
    found = effect_on(run.metrics[TOTAL], one, other, run, rows)
    stands = standing(one, other, found, found.p_value())
    if stands == TIED:
        return ": a tie"
    higher, beside = one.value > other.value, {scene: value for (scene, _), value in other.cells.items()}
    above = [(value > beside[scene]) is higher for (scene, _), value in one.cells.items()]
    text = f": {'higher' if higher else 'lower'} in {sum(above)} of {len(above)} roll-outs"
    if found.one_seed:
        return f"{text} of one seed, which judges no network"
    return f"{text}; of other motions and seeds it cannot be told" if stands == OPEN else text


def _cost(run: Run, timed: pd.DataFrame, scenes: list[str]) -> str:
    own, reference = pair(timed, NETWORK, run.reference, run_time(timed))
    if own is None or reference is None or not own.value:
        return ""
    text = f"{run.label(NETWORK)} takes {number(own.value)} ms a frame, the simulation "
    text += f"{number(reference.value)}: {number(reference.value / own.value, 2)} times as long{own.fewer}"
    more = fronts(run, run.cells("speed", "garments"), scenes, first_only=True) if scenes else ""
    return f"{text}; {more[:1].lower()}{more[1:]}" if more else f"{text}."


def _trust(run: Run, worn: pd.DataFrame, timed: pd.DataFrame) -> str:
    """What the network lacks, and how far the reference itself is uncertain."""
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
    counted = claims.counts(run)
    if counted:
        parts.append(f"of the paper's claims tested here: {claims.in_words(counted)}")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if parts else ""


def endings(run: Run) -> str:
    """How many cells, checks and stress tests ended how, with every kind that is not ok."""
    words = []
    for what, counts in tables.counted(run).items():
        found = [f"{counts[name]} {name}" for name in (*BAD, "skipped") if counts[name]]
        words.append(f"of {sum(counts.values()):,} {what} {', '.join(found) if found else 'all ended well'}")
    text = "; ".join(words)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def failures(run: Run) -> list[tuple[str, str]]:
    """(name, what happened): cells and checks that failed first, then stress tests, then overstretched
    networks; MOST of them in all, some of each kind.
    """
    rows = run.frame[run.frame["status"].isin(BAD)]
    rows = rows.assign(rank=rows["status"].map(BAD.index)).sort_values("rank", kind="stable")
    rows = rows.drop_duplicates(["scene", "method", "seed"])
    tested = rows["case"] != ""
    kinds: list[list[tuple[str, str]]] = [
        [
            (
                f"{run.label(row.method)}, {row.scene}" + (f", seed {row.seed}" if row.seed else ""),
                f"{row.status}: {row.reason}",
            )
            for row in part.itertuples()
        ]
        for part in (rows[~tested], rows[tested])
    ]
    kinds.append(
        [
            (
                f"{run.label(method)}, {scene}",
                f"{STRAIN[metric]} {number(own)} J, {number(ratio)} times the simulation's",
            )
            for method, scene, metric, own, ratio in overstretched(run)[:3]
        ]
    )
    found: list[tuple[str, str]] = []
    for left, kind in zip((3, 2, 1), kinds):
        found += kind[: max((MOST - len(found)) // left, 1)]
    return found[:MOST]


def overstretched(run: Run) -> list[tuple[str, str, str, float, float]]:
    """Method, scene, one of STRAIN, its value [J] and that over the simulation's: of trained networks, the
    worst first.
    """
    networks = [name for name in run.with_role("network") if not run.methods[name].base]
    found: dict[tuple[str, str], tuple[str, float, float]] = {}
    for metric in STRAIN:
        rows = run.frame[(run.frame["metric"] == metric) & run.frame["usable"] & (run.frame["garment"] != "")]
        values = rows.groupby(["scene", "method"])["value"].mean()
        for scene, method in values.index:
            base = values.get((scene, run.reference))
            if method in networks and base and (method, scene) not in found:
                found[method, scene] = (
                    metric,
                    float(values[scene, method]),
                    float(values[scene, method] / base),
                )
    worst = [(*key, *line) for key, line in found.items() if line[-1] > 1.0]
    return sorted(worst, key=lambda line: -line[-1])
