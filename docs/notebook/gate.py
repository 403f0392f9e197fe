"""Rates of false alarms and of misses of reports.compare: python docs/notebook/gate.py RUN_DIR COPIES [SEED].

False alarms: a noisy copy of the run has other seeds (the values of each network, on a scale of
logarithms, are drawn anew with the scatter that its seeds have, half of the variance alike in all
motions), other members of the reference's ensemble, times that scatter by 5 %, and one slow
frame. Misses: such a copy with one planted regression.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reports.comparison import compare
from reports.finished_run import Run, read_run
from reports.scene_changes import FAILING, Change


@dataclass(frozen=True)
class Scatter:
    """Scatter over seeds of one metric of one network: places of its rows, and mean and deviation of each.

    Attributes:
        places: (N,) rows of the run.
        seeds: (N,) their seeds.
        mean: (N,) over the seeds of the same scene, of logarithms where all values are positive.
        deviation: (N,) likewise.
        positive: whether all values are.
    """

    places: np.ndarray
    seeds: pd.Series
    mean: np.ndarray
    deviation: np.ndarray
    positive: bool


class NoisyCopies:
    """Copies of a run that another training and another machine load would give."""

    def __init__(self, run: Run) -> None:
        """Take the scatter over seeds from the rows of `run`."""
        rows = self.rows = run.frame
        machine = rows["metric"].str.startswith("cost/").to_numpy()
        self.timed = rows["unit"].isin(["ms", "s"]).to_numpy() & machine
        self.unseeded = (~rows["seeded"] & ~machine & rows["usable"]).to_numpy(dtype=bool)
        self.scatter = []
        for _, group in rows[rows["seeded"] & ~machine & rows["usable"]].groupby(["method", "metric"]):
            if group["seed"].nunique() > 1:
                positive = bool((group["value"] > 0).all())
                scale = np.log(group["value"]) if positive else group["value"]
                of_scene = scale.groupby(group["scene"])
                mean, deviation = (of_scene.transform(f).to_numpy() for f in ("mean", "std"))
                self.scatter.append(
                    Scatter(group.index.to_numpy(), group["seed"], mean, deviation, positive)
                )

    def draw(self, random: np.random.Generator) -> pd.DataFrame:
        """Return the rows of one copy."""
        values = self.rows["value"].to_numpy(dtype=float, copy=True)
        values[self.timed] *= np.exp(0.05 * random.standard_normal(self.timed.sum()))
        for group in self.scatter:
            alike = {seed: random.standard_normal() for seed in sorted(set(group.seeds))}
            z = random.standard_normal(len(group.places))
            new = group.mean + group.deviation * (z + group.seeds.map(alike).to_numpy()) / np.sqrt(2.0)
            values[group.places] = np.exp(new) if group.positive else new
        unsure = self.rows["uncertainty"].fillna(0.0).to_numpy(dtype=float)[self.unseeded]
        values[self.unseeded] += unsure * random.standard_normal(self.unseeded.sum())
        values[random.choice(np.flatnonzero(self.rows["metric"] == "cost/frame_worst"))] *= 5.0
        return self.rows.assign(value=values)


def planted(rows: pd.DataFrame, random: np.random.Generator) -> tuple[str, str, pd.DataFrame]:
    """Plant one regression; return its name, network and motion, and the rows."""
    strains = rows[
        (rows["suite"] == "garments")
        & rows["usable"]
        & rows["seeded"]
        & (rows["metric"] == "energy/strain")
    ]
    network = str(random.choice(strains["method"].unique()))
    scene = str(random.choice(strains[strains["method"] == network]["scene"].unique()))
    of_network, of_scene = rows["method"] == network, rows["scene"] == scene
    strain, time = rows["metric"] == "energy/strain", rows["metric"].isin(["cost/frame", "cost/whole"])
    slow = rows["method"].isin(["simulation", "skinning"])
    correlation = rows["metric"].str.endswith("correlation")
    kinds = {
        "correlations of the other sign": (of_network & correlation, -1.0),
        "strain x 3 on all motions, all that is unsure x 100": (of_network & strain, 3.0),
        "strain x 3 on one motion": (of_network & of_scene & strain, 3.0),
        "strain x 10 on one motion": (of_network & of_scene & strain, 10.0),
        "strain x 1.5 on all motions": (of_network & strain, 1.5),
        "simulation and skinning x 5 as slow": (slow & time, 5.0),
        "a method is gone": (of_network, 0.0),
        "a seed is gone": (of_network & (rows["seed"] == 1), 0.0),
        "a motion is gone": (of_scene, 0.0),
    }
    name = str(random.choice(list(kinds)))
    where, factor = kinds[name]
    place = f"{network} in {scene}"
    if factor == 0.0:
        return name, place, rows[~where]
    worse = rows.assign(value=rows["value"].where(~where, factor * rows["value"]))
    if "unsure" in name:
        worse["uncertainty"] *= 100.0
    return name, place, worse


def main(folder: str, copies: int, seed: int = 0) -> None:
    """Print both rates, a line for each false alarm and each miss."""
    run = read_run(RunFolder(folder))
    noisy = NoisyCopies(run)
    random = np.random.default_rng(seed)
    alarms, planted_counts, missed = 0, Counter[str](), Counter[str]()
    for done in range(1, copies + 1):
        copy = noisy.draw(random)
        for change in (changes := failures(run, copy)):
            print(f"false alarm: {change}", flush=True)
        alarms += bool(changes)
        name, place, worse = planted(copy, random)
        planted_counts[name] += 1
        if not failures(run, worse):
            missed[name] += 1
            print(f"missed: {name}, {place}", flush=True)
        if done % 10 == 0:
            print(f"{done} copies: {alarms} false alarms, {missed.total()} missed", flush=True)
    print(f"{alarms} false alarms in {copies} noisy copies")
    for name, count in sorted(planted_counts.items()):
        print(f"{name}: {missed[name]} of {count} missed")


def failures(run: Run, rows: pd.DataFrame) -> list[Change]:
    """Return the changes for which the gate fails."""
    changes = compare(run, replace(run, frame=rows.reset_index(drop=True))).changes
    return [change for change in changes if change.verdict in FAILING]


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
