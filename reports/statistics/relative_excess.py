"""Relative excess: share of skinning's excess energy over the reference that a method leaves, in %.

Of the total energy E of one motion and seed it is

    100 (E(method) - E(reference)) / (E(skinning) - E(reference)),

0 for the reference, 100 for the garment that only follows the skin, and below 0 for less energy than the
reference has. Any other energy whose zero is a choice, as gravity, is divided by the same excess. A garment
that falls loses ever more energy: below -100 it has fallen off, and its roll-out counts as failed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from reports.finished_run import Run
from reports.statistics.effects import EXCESS, Effect, effect, is_recorded, rescale, unscale
from reports.statistics.means_and_spreads import Mean, mean_by_recording, pair

TOTAL = "energy/total"
LEAST = -100.0  # [%] of a garment that is worn
OWN_EXCESS = "own_excess/total"
SKINNING = "skinning"  # the method that has 100 %
RELATIVE_EXCESS = Metric(
    name="relative_excess/total", unit="%", title="Relative excess",
    definition="excess of the total energy over the reference's as a share of skinning's excess",
    lower_is_better=True,
)  # fmt: skip


def relative_metric(metric: str) -> Metric:
    """Return the metric of relative excess of an energy such as energy/gravity.

    >>> relative_metric("energy/gravity").name
    'relative_excess/gravity'
    """
    if metric == TOTAL:
        return RELATIVE_EXCESS
    term = metric.partition("/")[2]
    definition = f"{term} above the reference's as a share of skinning's excess of total energy"
    name, title = f"relative_excess/{term}", f"Relative excess of {term}"
    return replace(RELATIVE_EXCESS, name=name, title=title, definition=definition)


def add_excess(
    run: Run, rows: pd.DataFrame, metric: str = TOTAL, *, basis: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Return the rows, and a row of the relative excess of each usable row of the metric.

    Scenes without reference, skinning or an excess of skinning have none. One is not usable where that of
    the cell's total, or its own without a total, is below LEAST. Rows that have them come back as they are.

    Args:
        run: declares the reference and its family, of which members that stalled are left out.
        rows: of the run, as Run.frame.
        metric: an energy.
        basis: rows whose reference and skinning are the basis; those given by default.
    """
    if (rows["metric"] == relative_metric(metric).name).any():
        return rows
    basis = rows if basis is None else basis
    sound = basis[(basis["status"] == "ok") | ~basis["method"].isin(run.reference_family)]
    zeros = _values(sound, metric, [run.reference, *run.reference_family])
    totals = _values(sound, TOTAL, [run.reference, *run.reference_family, SKINNING])
    sound_rows = rows[rows["usable"]]
    lines = sound_rows[sound_rows["metric"] == metric]
    wholes = sound_rows[sound_rows["metric"] == TOTAL]
    cell_energies = wholes.set_index(["scene", "method", "seed"])["value"].to_dict()
    parts = []
    columns = (lines[name].tolist() for name in ("scene", "method", "seed", "value", "uncertainty"))
    for place, scene, method, seed, energy, uncertainty in zip(lines.index, *columns):
        zero, total = zeros.get(scene, {}), totals.get(scene, {})
        shares = _shares(energy, zero, total)
        if run.reference in shares:
            value = shares.pop(run.reference)
            # The reference is zero by definition, whichever simulation it is.
            moved = () if method == run.reference else tuple((k, v - value) for k, v in shares.items())
            share = 100.0 / (total[SKINNING] - total[run.reference])
            whole = cell_energies.get((scene, method, seed))
            of_whole = value if whole is None else share * (whole - total[run.reference])
            parts.append((place, value, share * uncertainty, moved, of_whole >= LEAST))
    if not parts:
        return rows
    places, values, noises, moves, are_worn = map(list, zip(*parts))
    excesses = lines.loc[places].assign(
        metric=relative_metric(metric).name, unit="%", value=values, uncertainty=noises,
        moved=moves, usable=are_worn,
    )  # fmt: skip
    return pd.concat([rows, excesses[rows.columns]], ignore_index=True)


def _values(rows: pd.DataFrame, metric: str, methods: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return scene -> method -> mean over seeds of the metric."""
    cells = rows[(rows["metric"] == metric) & rows["usable"] & rows["method"].isin(methods)]
    values: dict[str, dict[str, float]] = {}
    for (scene, method), value in cells.groupby(["scene", "method"])["value"].mean().items():
        values.setdefault(scene, {})[method] = float(value)
    return values


def _shares(value: float, zeros: Mapping[str, float], totals: Mapping[str, float]) -> dict[str, float]:
    """Return reference -> relative excess [%] by the reference and by each member of its family."""
    return {
        name: 100.0 * (value - zeros[name]) / (totals[SKINNING] - totals[name])
        for name in zeros.keys() & totals.keys()
        if SKINNING in totals and totals[SKINNING] > totals[name]
    }


@dataclass(frozen=True)
class Excess:
    """Relative excess of a method over motions and seeds [%].

    Attributes:
        effect: against the reference, from which the verdict comes; its interval is that of `typical`.
        cells: (scene, seed) -> value.
        whole: scene -> skinning's excess energy over the reference [J], which is 100 %.
        fewer: remark on roll-outs that are missing, empty where none is.
    """

    effect: Effect
    cells: Mapping[tuple[str, int], float]
    whole: Mapping[str, float]
    fewer: str = ""

    @property
    def by_motion(self) -> dict[str, float]:
        """Scene -> mean over seeds."""
        return pd.Series(dict(self.cells)).groupby(level=0, sort=False).mean().to_dict()

    @property
    def pooled(self) -> float:
        """Excess energy, the mean over seeds, summed over motions, as a share of skinning's so summed."""
        return sum(self.whole[k] * v for k, v in self.by_motion.items()) / sum(self.whole.values())

    @property
    def typical(self) -> float:
        """Mean on the scale of effects.EXCESS, taken back: about the geometric mean over motions."""
        return self.effect.shown

    def typical_of(self, *, recorded: bool) -> float | None:
        """Return the typical value of recorded motions or of the others; None without any."""
        scaled = {
            cell: float(rescale(value, EXCESS)) for cell, value in self.cells.items()
            if is_recorded(cell[0]) == recorded
        }  # fmt: skip
        means = list(mean_by_recording(scaled).values())
        return float(unscale(float(np.mean(means)), EXCESS)) if means else None

    @property
    def worst(self) -> tuple[str, float]:
        """Scene with the largest relative excess, and its value."""
        return max(self.by_motion.items(), key=itemgetter(1))


def excess_of(run: Run, rows: pd.DataFrame, method: str) -> Excess | None:
    """Return the relative excess of a method over the scenes of these rows; None where there is none."""
    one, zero = pair_excesses(run, rows, method, run.reference)
    if one is None or zero is None:
        return None
    totals = _values(rows, TOTAL, [run.reference, SKINNING])
    scales = {motion: totals[motion][SKINNING] - totals[motion][run.reference] for motion, _ in one.cells}
    return Excess(effect(one, zero, EXCESS), one.cells, scales, one.fewer)


def own_excess_of(run: Run, rows: pd.DataFrame, method: str) -> Effect | None:
    """Return the excess in a method's own energies (benchmarks.metrics.own_energies); None without one.

    Its `shown` is the typical value [%] over the scenes of these rows.
    """
    rows = rows[(rows["metric"] == OWN_EXCESS) | ~rows["usable"]]
    rows = rows.assign(usable=rows["usable"] & ~(rows["value"] < LEAST))
    one, zero = pair(rows, method, run.reference, OWN_EXCESS)
    return effect(one, zero, EXCESS) if one and zero else None


def pair_excesses(
    run: Run, rows: pd.DataFrame, one: str, other: str, metric: str = TOTAL
) -> tuple[Mean | None, Mean | None]:
    """Return the mean relative excesses of two methods over the scenes that both have."""
    relative = relative_metric(metric).name
    rows = rows[rows["metric"].isin([metric, TOTAL, relative]) | ~rows["usable"]]
    return pair(add_excess(run, rows, metric), one, other, relative)
