"""Rates of false alarms and of misses of reports.compare: python docs/notebook/gate.py RUN_DIR COPIES.

False alarms: a noisy copy of the run has other seeds (the values of each network, on a scale of logarithms,
are drawn anew with the scatter that its seeds have, half of the variance alike in all motions), other members
of the reference's ensemble, and times that scatter by 5 %. Misses: such a copy with one planted regression.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reports.comparison.change import FAILING
from reports.comparison.compare_runs import compare
from reports.run.finished_run import Run
from reports.run.reading import read_run


def noisy(run: Run, random: np.random.Generator) -> pd.DataFrame:
    """Return the rows of a copy that another training and another machine load would give."""
    rows = run.frame.copy()
    values = rows["value"].to_numpy(dtype=float, copy=True)
    machine = rows["metric"].str.startswith("cost/").to_numpy()
    timed = rows["unit"].isin(["ms", "s"]).to_numpy() & machine
    values[timed] *= np.exp(0.05 * random.standard_normal(timed.sum()))
    networks = rows[rows["seeded"] & ~machine & rows["usable"]]
    for _, group in networks.groupby(["method", "metric"]):
        table = group.pivot_table(index="scene", columns="seed", values="value")
        if table.shape[1] < 2:
            continue
        positive = bool((table > 0).all(axis=None))
        scale = np.log(table) if positive else table
        means, scatter = scale.mean(axis=1), scale.std(axis=1, ddof=1)
        alike = dict(zip(table.columns, random.standard_normal(table.shape[1])))
        draw = (random.standard_normal(len(group)) + group["seed"].map(alike)) / np.sqrt(2.0)
        new = group["scene"].map(means) + group["scene"].map(scatter) * draw
        values[group.index] = np.exp(new) if positive else new
    plain = ~rows["seeded"] & ~machine & rows["usable"]
    unsure = rows["uncertainty"].fillna(0.0).to_numpy(dtype=float)
    values[plain] += unsure[plain] * random.standard_normal(plain.sum())
    rows["value"] = values
    return rows


def planted(rows: pd.DataFrame, random: np.random.Generator) -> tuple[str, pd.DataFrame]:
    """Plant one regression; return its name and the rows."""
    worn = rows[(rows["suite"] == "garments") & rows["usable"]]
    network = str(random.choice(worn[worn["seeded"]]["method"].unique()))
    scene = str(random.choice(worn["scene"].unique()))
    of_network, of_scene = rows["method"] == network, rows["scene"] == scene
    strain, time = rows["metric"] == "energy/strain", rows["metric"].isin(["cost/frame", "cost/whole"])
    slow = rows["method"].isin(["simulation", "skinning"])
    kinds = {
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
    if factor == 0.0:
        return name, rows[~where]
    return name, rows.assign(value=rows["value"].where(~where, factor * rows["value"]))


def main(folder: str, copies: int) -> None:
    """Print both rates."""
    run = read_run(RunFolder(folder))
    random = np.random.default_rng(0)
    alarms, asked, missed = 0, Counter[str](), Counter[str]()
    for _ in range(copies):
        copy = noisy(run, random)
        alarms += fails(run, copy)
        name, worse = planted(copy, random)
        asked[name] += 1
        missed[name] += not fails(run, worse)
    print(f"{alarms} false alarms in {copies} noisy copies")
    for name, count in sorted(asked.items()):
        print(f"{name}: {missed[name]} of {count} missed")


def fails(run: Run, rows: pd.DataFrame) -> bool:
    """Return whether the gate fails."""
    changes = compare(run, replace(run, frame=rows.reset_index(drop=True))).changes
    return any(change.verdict in FAILING for change in changes)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
