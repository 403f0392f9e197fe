"""The curve of a training at the paper's size, over its time.

Microbenchmark convergence/4400 of suite performance leaves it in the folder of a run.
"""

from __future__ import annotations

import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reports.figures.plotting import PAGE_WIDTH, Picture, grid, log_axis, new_figure, save
from reports.figures.styles import KNOWN

PAPER_SECONDS = 2 * 3600.0  # the paper's training: 4424 vertices, 6500 frames, a GPU
CURVES = {"validation": ("rolled out on a held-out motion", "-"), "loss": ("windows of training", ":")}


def convergence_curve(folder: RunFolder, problems: list[str]) -> list[Picture]:
    """Loss and held-out roll-out against the time of training [s], beside the paper's two hours."""
    path = folder.path / "convergence.csv"
    if not path.is_file():
        return []
    try:
        curve = pd.read_csv(path)[["seconds", *CURVES]].astype(float).dropna()
    except (KeyError, ValueError) as error:
        problems.append(f"{path.name}: not a curve of a training ({error})")
        return []
    if curve.empty:
        return []
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
    return [save(figure, folder.figures, "convergence", caption=caption, kind="convergence")]
