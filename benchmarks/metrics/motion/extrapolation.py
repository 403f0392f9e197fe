"""Metrics motion/*: a method on what it was not made for: strain, distance from skinning, recovery.

Each is held against the same method in the scene's counterpart, the ordinary walk. A network never hears of
another material: its energy is by the one that it should have heard of. A network's shirt that has left the
body has diverged; a simulated shirt may be where it likes: of a body that jumps by a metre it has to be left
behind.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Metric, skinned
from benchmarks.metrics.energies import energy
from benchmarks.metrics.surface import penetration_and_distances as geometry

if TYPE_CHECKING:
    from benchmarks.metric import RollOut
    from reference_sim.cloth import Cloth

AFTER = (1, 10, 30)  # frames after the glitch
MM = 1e3
LOST = 0.5  # [m] from the skinned shirt: a vertex so far off is on no body any more

_metric = partial(Metric, table="extrapolation", lower_is_better=True)

METRICS = (
    _metric(name="motion/strain", unit="J", title="Worst strain",
            definition="membrane energy of the worst frame"),
    _metric(name="motion/strain_ratio", unit="1", title="Over the walk's",
            definition="the same over that of the same method on the ordinary walk and cloth"),
    _metric(name="motion/offset", unit="mm", title="From skinning", lower_is_better=None,
            definition="largest distance of a vertex from the skinned garment, over all frames"),
    _metric(name="motion/penetration", unit="%", title="Penetration",
            definition="vertices inside the body, mean over frames"),
    _metric(name="motion/total", unit="J", title="Total energy",
            definition="sum of all terms by the changed material, mean over frames"),
    *(_metric(name=f"motion/recovery_{after}", unit="mm", title=f"{after} frames after",
              definition=f"distance to the walk without the wrong frame, {after} frames after it")
      for after in AFTER),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the metrics of a scene that was made hard, each against the same method's ordinary walk."""
    scene, x, whole = roll_out.scene, roll_out.positions, roll_out.trajectory.positions
    bare = roll_out.group.kept(skinned)
    if scene.dressed is None or bare is None:
        return {}
    worst = float(strains(scene.cloth, whole).max())
    values = {
        "motion/strain": worst,
        "motion/offset": MM * float(np.linalg.norm(whole - bare[: len(whole)], axis=2).max()),
    }
    garment, ordinary = scene.dressed.garment, roll_out.counterpart
    if ordinary is not None:
        values["motion/strain_ratio"] = worst / float(strains(garment.cloth(), ordinary).max())
    if scene.obstacle is not None:
        values["motion/penetration"] = 100.0 * float(geometry.inside_of(roll_out).share.mean())
    if scene.cloth.material != garment.material and len(x) == scene.frames:
        values["motion/total"] = float(energy.energies(roll_out)["total"][roll_out.judged].mean())
    if scene.glitch is not None and ordinary is not None:
        apart = geometry.distance_rms(whole, ordinary[: len(whole)])
        values |= {
            f"motion/recovery_{after}": MM * float(apart[scene.glitch + after])
            for after in AFTER
            if scene.glitch + after < len(apart)
        }
    return values


def judge(roll_out: RollOut, values: dict[str, float]) -> tuple[str, str] | None:
    """Return that a network diverged whose garment left the body, or None."""
    far = values.get("motion/offset", 0.0) / MM
    if roll_out.entry.trained and far > LOST:
        return "diverged", f"a vertex came {far:.2g} m away from the skinned shirt"
    return None


def strains(cloth: Cloth, positions: np.ndarray) -> np.ndarray:
    """Return the membrane energy of positions (T,V,3) [m], (T,) [J]; infinite where one is not finite."""
    from reference_sim.energies.stretch_stvk import StretchStVK  # loads numba

    term, finite = StretchStVK(cloth), np.isfinite(positions).all(axis=(1, 2))
    return np.array(
        [term.value_and_gradient(np.ascontiguousarray(x))[0] if fine else np.inf
         for x, fine in zip(positions, finite)]
    )  # fmt: skip
