"""How a hem answers to the body's motion, frame by frame: the swing that no energy of a frame shows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, file_name, grid, legend_above, new_figure, save
from reports.vtkhdf import MeshSeries

CURVES = (
    ("hem/yaw", "yaw of the hem [degrees]", np.degrees(1.0)),
    ("hem/from_end", "from its end [mm]", 1e3),
)
LEAST = np.radians(5.0)  # of yaw: with less there is no swing to see


def hem_curves(folder: Path, scene: str, series: Mapping[str, MeshSeries]) -> Picture | None:
    """Yaw of the hem in the root's axes and its distance from where it ends, a curve per method.

    None for a scene without these curves, or whose hem hardly turns.
    """
    methods = [m for m in palette.ordered(series) if all(name in series[m].fields for name, _, _ in CURVES)]
    if not methods or max(float(np.nanmax(np.abs(series[m].fields["hem/yaw"]))) for m in methods) < LEAST:
        return None
    figure = new_figure(PAGE_WIDTH, 2.6)
    for axes, (name, title, scale) in zip(figure.subplots(1, len(CURVES)), CURVES):
        for method in reversed(methods):  # the reference last, on top
            look, mesh = palette.style(method), series[method]
            axes.plot(mesh.times, scale * mesh.fields[name], color=look.colour, linestyle=look.line)
        axes.set(title=title, xlabel="time [s]")
        grid(axes)
    legend_above(figure, methods, lines=True)
    caption = f"{scene}: the hem in the axes of the root. What goes past the end after the body has stopped "
    caption += "is swing; a curve that ends with the body has none."
    name = f"hem_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, section="garments", kind="hem")
