"""python -m reports.convergence DIR: the curve of a training at the paper's size, over its time.

Reads convergence.csv, which microbenchmark convergence/4400 of suite performance leaves in the folder of a
run; writes convergence.png there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from benchmarks.results import ResultsError
from reports.plotting import PAGE_WIDTH, Picture, grid, log_axis, new_figure, save
from reports.styles import KNOWN

PAPER_SECONDS = 2 * 3600.0  # the paper's training: 4424 vertices, 6500 frames, a GPU
CURVES = {"validation": ("rolled out on a held-out motion", "-"), "loss": ("windows of training", ":")}


def read_curve(path: Path) -> pd.DataFrame:
    """Seconds of training, and for each name in CURVES joules a frame. Raises ResultsError."""
    try:
        curve = pd.read_csv(path)[["seconds", *CURVES]].astype(float)
    except FileNotFoundError:
        raise ResultsError(f"{path}: no such file; see --scenes convergence/4400") from None
    except (KeyError, ValueError) as error:
        raise ResultsError(f"{path}: not a curve of a training ({error})") from None
    if curve.empty or curve.isna().any(axis=None):
        raise ResultsError(f"{path}: holds no rows, or not all of their numbers")
    return curve


def convergence_curve(folder: Path) -> Picture:
    """Loss and held-out roll-out against the time of training, beside the paper's two hours."""
    curve = read_curve(folder / "convergence.csv")
    figure = new_figure(PAGE_WIDTH * 0.7, 2.6)
    axes = figure.subplots()
    for name, (label, line) in CURVES.items():
        colour = KNOWN["snug"].colour
        axes.plot(curve["seconds"], curve[name], color=colour, linestyle=line, label=label)
    axes.axvline(PAPER_SECONDS, color="#444444", linestyle="--", linewidth=0.9)
    axes.annotate("the paper's 2 h", (PAPER_SECONDS, 0.97), xycoords=axes.get_xaxis_transform(),
        xytext=(-4, 0), textcoords="offset points", ha="right", va="top", fontsize=8)  # fmt: skip
    axes.set(xlabel="time of training [s]", ylabel="energy [J per frame]")
    first, last = curve["seconds"].iloc[[0, -1]]
    axes.set_xlim(0.8 * first, 1.3 * max(PAPER_SECONDS, last))
    log_axis(axes, "x")
    grid(axes)
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    caption = "SNUG trained at the paper's size: energy of a frame against the time of training."
    return save(figure, folder, "convergence", caption=caption, kind="training", vector=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0 drawn, 2 no such curve."""
    parser = argparse.ArgumentParser(
        prog="python -m reports.convergence",
        description="Draw the curve of a training: convergence.png beside its convergence.csv.",
        epilog="example: python -m reports.convergence reports/runs/mine",
    )
    parser.add_argument("folder", metavar="DIR", help="folder of a run that holds convergence.csv")
    options = parser.parse_args(arguments)
    try:
        print(convergence_curve(Path(options.folder)).path)
    except ResultsError as error:
        print(f"reports.convergence: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
