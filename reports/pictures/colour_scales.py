"""Colour scales of cloths: one-step error, distance, change of area, curvature, penetration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.chosen_roll_outs import SceneRollOuts
from reports.run.roll_outs import STEP
from reports.statistics.vertex_values import area_change, depth, distance, mean_curvature, skin_of

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

FULL = 97.0  # percentile of the values of the worst method: it has the darkest colour
NOTHING = 1e-6  # of a scale's unit: what is less everywhere is not shown


@dataclass(frozen=True)
class Scale:
    """Scale that cloths are coloured by: title with its unit, and method -> (V,) values from 0 up."""

    title: str
    values: Mapping[str, np.ndarray]

    @property
    def top(self) -> float:
        """Value with the darkest colour."""
        return max(float(np.percentile(np.nan_to_num(values), FULL)) for values in self.values.values())

    def colours(self, method: str) -> np.ndarray:
        """Return colours (V,3), pale to dark in grey too."""
        share = np.nan_to_num(self.values[method]) / max(self.top, np.finfo(float).tiny)
        return colour_map()(np.clip(share, 0.0, 1.0))[:, :3]


def colour_map() -> Colormap:
    """Return the colours from pale to dark."""
    from matplotlib import colormaps

    return colormaps["YlOrRd"]


def scales(roll_outs: SceneRollOuts, methods: Sequence[str], frame: int, reference: str) -> dict[str, Scale]:
    """Return the scales, by name, that are known of all of these methods at that frame."""
    cloths = {method: roll_outs.series[method] for method in methods}
    at = {m: cloth.positions[frame] for m, cloth in cloths.items()}
    known = {}
    if roll_outs.has_steps(methods):
        known["step"] = Scale(
            "one-step error [mm]", {m: c.frame_fields[STEP][frame] for m, c in cloths.items()}
        )
    if reference in at and all(np.array_equal(c.faces, cloths[reference].faces) for c in cloths.values()):
        away = {m: distance(x[None], at[reference][None])[0] for m, x in at.items()}
        known["distance"] = Scale("from the simulation [mm]", away)
    if roll_outs.rest is not None and all(len(c.faces) == len(roll_outs.rest) for c in cloths.values()):
        strain = {m: np.abs(area_change(x[None], cloths[m].faces, roll_outs.rest)[0]) for m, x in at.items()}
        known["strain"] = Scale("change of area [%]", strain)
    bent = {m: mean_curvature(x[None], cloths[m].faces)[0] for m, x in at.items()}
    known["curvature"] = Scale("mean curvature [1/m]", bent)
    body = roll_outs.body
    skin = skin_of(body.positions[frame], body.faces) if body and frame < body.frames else None
    if skin:
        deep = {m: depth(x, skin, 0) for m, x in at.items()}
        known["depth"] = Scale("penetration [mm]", deep)
    return {name: scale for name, scale in known.items() if scale.top > NOTHING}
