"""Metrics motion/* and roll_out/*: a method on what it was not made for, and on a motion that comes again.

Metrics motion/*: a method on what it was not made for: strain, distance from skinning, recovery.

Each is held against the same method in the scene's counterpart, the ordinary walk. A network never hears of
another material: its energy is by the one that it should have heard of. A network's shirt that has left the
body has diverged; a simulated shirt may be where it likes: of a body that jumps by a metre it has to be left
behind.

Metrics roll_out/*: does a garment look the same when the same motion comes again, much later?

Energies are those of the cloth alone (strain, bending, inertia), which need no body; the first two frames of
either stretch have no inertia and are left out.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, Metric, skinned
from benchmarks.metrics import energy
from benchmarks.metrics import penetration_and_distances as geometry
from benchmarks.metrics.energy import FIRST_FULL_FRAME, energies

if TYPE_CHECKING:
    from benchmarks.metric import RollOut
    from reference_sim.cloth import Cloth

AFTER = (1, 10, 30)  # frames after the glitch
MM = 1e3
LOST = 0.5  # [m] from the skinned shirt: a vertex so far off is on no body any more

_metric_extrapolation = partial(Metric, table="extrapolation", lower_is_better=True)

EXTRAPOLATION_METRICS = (
    _metric_extrapolation(name="motion/strain", unit="J", title="Worst strain",
            definition="membrane energy of the worst frame"),
    _metric_extrapolation(name="motion/strain_ratio", unit="1", title="Over the walk's",
            definition="the same over that of the same method on the ordinary walk and cloth"),
    _metric_extrapolation(name="motion/offset", unit="mm", title="From skinning", lower_is_better=None,
            definition="largest distance of a vertex from the skinned garment, over all frames"),
    _metric_extrapolation(name="motion/penetration", unit="%", title="Penetration",
            definition="vertices inside the body, mean over frames"),
    _metric_extrapolation(name="motion/total", unit="J", title="Total energy",
            definition="sum of all terms by the changed material, mean over frames"),
    *(_metric_extrapolation(name=f"motion/recovery_{after}", unit="mm", title=f"{after} frames after",
              definition=f"distance to the walk without the wrong frame, {after} frames after it")
      for after in AFTER),
)  # fmt: skip


def measure_extrapolation(roll_out: RollOut) -> dict[str, float]:
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


OF_CLOTH = ("strain", "bending", "inertia")

_metric_long_roll_out = partial(Metric, table="roll_outs", lower_is_better=True)

LONG_ROLL_OUT_METRICS = (
    _metric_long_roll_out(name="roll_out/first", unit="J", title="Energy, first",
            definition="strain, bending and inertia, mean over the frames of the early stretch"),
    _metric_long_roll_out(name="roll_out/last", unit="J", title="Energy, last",
            definition="the same of the late stretch, which shows the same motion"),
    _metric_long_roll_out(name="roll_out/drift", unit="mm", title="Drift",
            definition="root mean square distance between the two stretches, about the pelvis"),
)  # fmt: skip


def measure_long_roll_out(roll_out: RollOut) -> dict[str, float]:
    """Return energies [J] of the early and the late stretch, and the drift between both [mm]."""
    scene, x = roll_out.scene, roll_out.positions
    if scene.repeated is None or scene.dressed is None or len(x) < scene.frames:
        return {}
    early, late = scene.repeated
    kept = np.arange(len(x)) if scene.kept is None else scene.kept
    origins = scene.dressed.motion.translations[kept]
    cloth = np.sum([series for term, series in energies(roll_out).items() if term in OF_CLOTH], axis=0)
    moved = (x[late] - x[early]) - (origins[late] - origins[early])[:, None]
    return {
        "roll_out/first": float(cloth[early][FIRST_FULL_FRAME:].mean()),
        "roll_out/last": float(cloth[late][FIRST_FULL_FRAME:].mean()),
        "roll_out/drift": MM * float(np.sqrt((moved[FIRST_FULL_FRAME:] ** 2).sum(-1).mean())),
    }


EXTRAPOLATION = Measurements(
    "extrapolation", EXTRAPOLATION_METRICS, measure=measure_extrapolation, judge=judge, where_named=True
)

LONG_ROLL_OUT = Measurements(
    "roll_out", LONG_ROLL_OUT_METRICS, measure=measure_long_roll_out, where_named=True
)
