"""Tables and the figure of a run of this study: python textile_tables.py RUN [FOLDER], from its results.csv.

| file | content |
| --- | --- |
| fabric_order | errors of each method in both tests, and pairs of fabrics that it turns round |
| fabric_drape | drape coefficient by the reference on several meshes and at several time steps [%] |
| fabric_bands | published drape coefficients, and the bending lengths that give them by the reference |
| textile_errors.png | errors of both tests against run time |
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

import pandas as pd

from fabrics import FABRICS
from rest_shapes import BANDS, DISCS
from specimens import BENDING_LENGTH, DRAPE

TESTS = {"cantilever": BENDING_LENGTH, "drape": DRAPE}
# Below, the order of two fabrics is not asked for: drape coefficients of one fabric differ by 4 points
# between meshes and time steps, as the number of folds does.
APART = {"cantilever": 0.5, "drape": 5.0}  # [mm], [points]
UNITS = {"cantilever": "%", "drape": "points"}  # of an error


def tables(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return name -> table, from the rows of results.csv."""
    rows = rows[(rows["suite"] == "fabric") & rows["status"].isin(["ok", "stalled"])]
    checks = rows[rows["metric"] == "check"].set_index("scene")["value"]
    return {
        "fabric_order": order_table(rows),
        "fabric_drape": drapes(checks),
        "fabric_bands": bands(checks),
    }


def drapes(checks: pd.Series) -> pd.DataFrame:
    """Tabulate the reference's drape coefficients, from scene -> value."""
    lines = [
        {"fabric": fabric.name, "bending_length [mm]": round(1e3 * fabric.bending_length, 1)}
        | {
            f"rings_{r}_steps_{s} [%]": checks.get(f"drape_{fabric.name}_{r}_rings_{s}_steps")
            for r, s in DISCS
        }
        for fabric in FABRICS
    ]
    return pd.DataFrame(lines)


def bands(checks: pd.Series) -> pd.DataFrame:
    """Tabulate published drape coefficients and the bending lengths that give them, from scene -> value."""
    ends = ("least", "largest")
    lines = [
        {"class": name}
        | {f"{end} [%]": coefficient for end, coefficient in zip(ends, band)}
        | {f"length_{end} [mm]": checks.get(f"drape_band_{name}_{end}") for end in ends}
        for name, band in BANDS.items()
    ]
    return pd.DataFrame(lines)


def order_table(rows: pd.DataFrame) -> pd.DataFrame:
    """Tabulate each method's run time of a drape, its mean errors, and the pairs that it turns round."""
    tests = {test: rows[rows["scene"].str.startswith(f"fabric/{test}/")] for test in TESTS}
    means = {
        test: of_test.groupby(["method", "metric"])["value"].mean() for test, of_test in tests.items()
    }
    lines = []
    for method in tests["drape"]["method"].unique():
        line = {"method": method, "time [ms]": means["drape"].get((method, "cost/frame"))}
        line |= {f"{t}_error [{UNITS[t]}]": means[t].get((method, "fabric/error")) for t in TESTS}
        worst = None
        for test, of_test in tests.items():
            readings = of_test[of_test["metric"] == TESTS[test]].pivot(
                index="scene", columns="method", values="value"
            )
            one, reference = (
                readings.get(m, pd.Series(dtype=float)).dropna() for m in (method, "simulation")
            )
            turned, pairs = order(one, reference, APART[test])
            line[f"{test}_turned"] = f"{len(turned)} of {pairs}"
            if turned:
                low, high = (scene.split("/", 2)[2] for scene in turned[0])
                worst = f"{low} above {high} ({test})"
        lines.append(line | {"worst": worst})
    return pd.DataFrame(lines)


def order(
    readings: Mapping[str, float] | pd.Series, reference: Mapping[str, float] | pd.Series, gap: float
) -> tuple[list[tuple[str, str]], int]:
    """Compare the order of a method's readings with that of the reference's, by fabric.

    Returns:
        Pairs that stand the other way round than by the reference, the worst first, (lower, higher) by
        the reference; and the number of pairs that the reference tells apart and the method has.

    >>> order({"a": 3.0, "b": 2.0}, {"a": 1.0, "b": 9.0}, gap=1.0)
    ([('a', 'b')], 1)
    """
    pairs, turned = 0, []
    for pair in combinations([name for name in dict(reference) if name in readings], 2):
        low, high = sorted(pair, key=lambda name: reference[name])
        if reference[high] - reference[low] < gap:
            continue
        pairs += 1
        if readings[low] > readings[high]:
            turned.append((readings[low] - readings[high], (low, high)))
    return [pair for _, pair in sorted(turned, reverse=True)], pairs


def draw(table: pd.DataFrame, rows: pd.DataFrame, path: Path) -> None:
    """Draw the errors of both tests against run time, members of a family joined, from `fabric_order`."""
    import matplotlib.pyplot as plt

    family = rows.drop_duplicates("method").set_index("method")["family"]
    table = table[table["time [ms]"].notna()].assign(
        family=lambda t: t["method"].map(family).fillna(t["method"])
    )
    figure, panels = plt.subplots(1, 2, figsize=(10, 5), layout="constrained")
    for axes, test in zip(panels, TESTS):
        for name, members in table.groupby("family", sort=False):
            line = members.sort_values("time [ms]").dropna(subset=f"{test}_error [{UNITS[test]}]")
            axes.plot(line["time [ms]"], line[f"{test}_error [{UNITS[test]}]"], "o-", label=name)
        axes.set(xscale="log", yscale="log", xlabel="run time of the drape [ms per frame]")
        axes.set_title(f"{TESTS[test].split('/')[1].replace('_', ' ')}: error [{UNITS[test]}]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center", fontsize=8)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def markdown(table: pd.DataFrame) -> str:
    """Return a table in Markdown, numbers with three digits.

    >>> print(markdown(pd.DataFrame([{"drape_error [points]": 1.23456}])))
    | Drape error [points] |
    | --- |
    | 1.23 |
    """
    cells = [[f"{c:.3g}" if isinstance(c, float) else c for c in line] for line in
             table.astype(object).where(table.notna(), "-").itertuples(index=False)]  # fmt: skip
    heads = [name[0].upper() + name[1:].replace("_", " ") for name in table.columns]
    lines = [heads, ["---"] * len(table.columns), *cells]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


if __name__ == "__main__":
    rows = pd.read_csv(next(Path(sys.argv[1]).glob("results.csv*")), low_memory=False)
    made = tables(rows)
    for name, table in made.items():
        print(f"{name}\n\n{markdown(table)}\n")
        if sys.argv[2:]:
            table.to_csv(Path(sys.argv[2]) / f"{name}.csv", index=False, float_format="%.9g", na_rep="-")
    if sys.argv[2:]:
        draw(made["fabric_order"], rows, Path(sys.argv[2]) / "textile_errors.png")
