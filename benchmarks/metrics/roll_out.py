"""Metrics motion/* and roll_out/*: a method on what it was not made for, and on a motion that comes again.

In motion/* a method is held against itself in the scene's counterpart, the ordinary walk. A network's shirt
that has left the body has diverged; a simulated one has to be left behind by a body that jumps by a metre.

In roll_out/* one motion is seen early and much later. Energies are those of the cloth alone (strain,
bending, inertia); the first two frames of either stretch are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of
from benchmarks.metrics import penetration_and_distances as geometry
from benchmarks.metrics.energy import FIRST_FULL_FRAME, energies

if TYPE_CHECKING:
    from benchmarks.metric import RollOut
    from reference_sim.cloth import Cloth

AFTER = (1, 10, 30)  # frames after the glitch
OF_CLOTH = ("strain", "bending", "inertia")
LOST = 0.5  # [m] from the skinned shirt: farther off is on no body


def measure_extrapolation(roll_out: RollOut) -> dict[str, float]:
    """Return the metrics of a scene that was made hard, each against the same method's ordinary walk."""
    scene, x, track = roll_out.scene, roll_out.positions, roll_out.trajectory.positions
    bare = scene.skinned
    if scene.dressed is None or bare is None:
        return {}
    worst = float(strains(scene.cloth, track).max())
    values = {
        "motion/strain": worst,
        "motion/offset": geometry.MM * float(np.linalg.norm(track - bare[: len(track)], axis=2).max()),
    }
    garment, ordinary = scene.dressed.garment, roll_out.counterpart
    if ordinary is not None:
        values["motion/strain_ratio"] = worst / float(strains(garment.cloth(), ordinary).max())
    if scene.obstacle is not None:
        values["motion/penetration"] = 100.0 * float(geometry.inside_of(roll_out).share.mean())
    if scene.cloth.material != garment.material and len(x) == scene.frames:
        values["motion/total"] = float(energies(roll_out)["total"][roll_out.judged].mean())
    if scene.glitch is not None and ordinary is not None:
        gaps = geometry.distance_rms(track, ordinary[: len(track)])
        values |= {
            f"motion/recovery_{after}": geometry.MM * float(gaps[scene.glitch + after])
            for after in AFTER
            if scene.glitch + after < len(gaps)
        }
    return values


def judge(roll_out: RollOut, values: dict[str, float]) -> tuple[str, str] | None:
    """Return that a network diverged whose garment left the body, or None."""
    offset = values.get("motion/offset", 0.0) / geometry.MM
    if roll_out.entry.trained and offset > LOST:
        return "diverged", f"a vertex came {offset:.2g} m away from the skinned shirt"
    return None


def strains(cloth: Cloth, positions: np.ndarray) -> np.ndarray:
    """Return the membrane energy of positions (T,V,3) [m], (T,) [J]; infinite where one is not finite."""
    from reference_sim.energies.stretch_stvk import StretchStVK  # loads numba

    term, finite = StretchStVK(cloth), np.isfinite(positions).all(axis=(1, 2))
    return np.array(
        [term.value_and_gradient(np.ascontiguousarray(x))[0] if is_finite else np.inf
         for x, is_finite in zip(positions, finite)]
    )  # fmt: skip


def measure_long_roll_out(roll_out: RollOut) -> dict[str, float]:
    """Return energies [J] of the early and the late stretch, and the drift between both [mm]."""
    scene, x = roll_out.scene, roll_out.positions
    if scene.repeated is None or scene.dressed is None or len(x) < scene.frames:
        return {}
    early, late = scene.repeated
    frames = np.arange(len(x)) if scene.kept is None else scene.kept
    origins = scene.dressed.motion.translations[frames]
    cloth = np.sum([series for term, series in energies(roll_out).items() if term in OF_CLOTH], axis=0)
    moved = (x[late] - x[early]) - (origins[late] - origins[early])[:, None]
    return {
        "roll_out/first": float(cloth[early][FIRST_FULL_FRAME:].mean()),
        "roll_out/last": float(cloth[late][FIRST_FULL_FRAME:].mean()),
        "roll_out/drift": geometry.MM * float(np.sqrt((moved[FIRST_FULL_FRAME:] ** 2).sum(-1).mean())),
    }


EXTRAPOLATION = Measurements(
    "extrapolation",
    metrics_of(
        ("motion/strain", "J", "Worst strain", "membrane energy of the worst frame"),
        ("motion/strain_ratio", "1", "Over the walk's",
         "worst membrane energy over that of the same method on the ordinary walk and cloth"),
        ("motion/offset", "mm", "From skinning",
         "largest distance of a vertex from the skinned garment, over all frames", {"lower_is_better": None}),
        ("motion/penetration", "%", "Penetration", "vertices inside the body, mean over frames"),
        ("motion/total", "J", "Total energy",
         "sum of all terms by the changed material, mean over frames"),
        *((f"motion/recovery_{after}", "mm", f"{after} frames after",
           f"distance to the walk without the wrong frame, {after} frames after it") for after in AFTER),
        table="extrapolation", lower_is_better=True,
    ),
    measure=measure_extrapolation, judge=judge, where_named=True,
)  # fmt: skip
LONG_ROLL_OUT = Measurements(
    "roll_out",
    metrics_of(
        ("roll_out/first", "J", "Energy, first",
         "strain, bending and inertia, mean over the frames of the early stretch"),
        ("roll_out/last", "J", "Energy, last",
         "strain, bending and inertia, mean over the late stretch, which shows the same motion"),
        ("roll_out/drift", "mm", "Drift",
         "root mean square distance between the two stretches, about the pelvis"),
        table="roll_outs", lower_is_better=True,
    ),
    measure=measure_long_roll_out, where_named=True,
)  # fmt: skip
