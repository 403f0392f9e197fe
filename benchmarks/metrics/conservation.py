"""Metrics conservation/*: which laws of a backward-Euler step a roll-out keeps, frame by frame.

For the step from x, v to x', v' = (x' - x)/dt the laws are, with every external force at x':

    momentum            P' - P = dt sum F
    angular momentum    L' - L = dt tau(x') - dt sum m v x v'           about the pelvis, still for the step
    energy              Phi(x') + |v' - v|_M^2/2 <= Phi(x) + |v|_M^2/2
    descent             Psi(x') <= Psi(guess), Psi = Phi + |x - x_hat|_M^2 / (2 dt^2)
    residual            grad Psi(x') = 0

v comes from the method's own two frames before, so each is held to its own past. Forces of strain and
bending sum to nothing and turn nothing, so the first two laws do not depend on the material.

Contact planes are those a solver would freeze for this step: found at its first guess from the method's own
previous frame. All terms of a law stand on these same planes. With each side on its own planes the energy
law would be false even for an exact minimiser, for a moving body does work on the cloth; on the same planes
that work, Phi(x) on the new planes less Phi(x) on the old, is on the right-hand side. That makes the right
side large where the body moves into the cloth: descent is the sharper law, because the guess has been carried
along with the body, at no cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Measurements, metrics_of
from benchmarks.metrics.energy import FIRST_FULL_FRAME, copied_terms, step_to
from reference_sim.material import GRAVITY

if TYPE_CHECKING:
    from benchmarks.metric import RollOut, SceneRollOuts
    from benchmarks.scene import BuiltScene
    from reference_sim.energies.energy import Step
    from reference_sim.potential import Potential

Floats = NDArray[np.float64]

CLAIMED = "the worst frame that claims to have converged"
RISE = 1e-9  # of the larger side: beyond it, a frame breaks an inequality


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return how far each law is broken, for the methods that are declared `conserving`."""
    if roll_out not in _asked(roll_out.group):
        return {}
    laws = roll_out.group.kept(_laws_of)[roll_out]
    values = laws.metrics(roll_out.scene.warm_up - FIRST_FULL_FRAME)
    if roll_out is not roll_out.group.reference:
        return values
    fields, frames = roll_out.trajectory.frame_fields, roll_out.trajectory.frames
    claims = fields.get("converged", np.ones(frames))[FIRST_FULL_FRAME:] > 0.5
    worst = {"momentum": laws.force / laws.weight, "energy": laws.rise, "residual": laws.residual}
    if claims.any():
        values |= {
            f"conservation/{name}_worst": max(0.0, float(v[claims].max())) for name, v in worst.items()
        }
    return values


def _asked(group: SceneRollOuts) -> list[RollOut]:
    scene = group.scene
    of_steps = scene.substeps == 1 and scene.frames > FIRST_FULL_FRAME
    if scene.dressed is None or len(scene.cloth.pins) or not of_steps:
        return []
    whole = [r for r in group.roll_outs if r.entry.conserving and len(r.positions) == scene.frames]
    # Solvers stopped early leave self-contact out, so they keep no law of it.
    return [r for r in whole if not r.entry.truncated] if scene.minimised else whole


def _laws_of(group: SceneRollOuts) -> dict[RollOut, LawSeries]:
    """Return the laws of all conserving roll-outs at once: they share the search trees."""
    asked = _asked(group)
    # Of the terms that simulations minimise, self-contact among them.
    scene = replace(group.scene, energies=group.scene.simulated_energies)
    return dict(zip(asked, law_series(scene, [roll_out.positions for roll_out in asked])))


@dataclass(frozen=True)
class LawSeries:
    """Residuals of the laws at each step, of the frames that have two before them: (T - 2,) each.

    force: |P' - P - dt sum F|/dt [N]; torque: the same of angular momentum [N m]; rise and climb: how far
    energy and descent are broken [J], below zero where they hold, and the size [J] of what they compare;
    residual and residual_rms: of grad Psi, largest component and root mean square [mean vertex weights].
    """

    weight: float  # [N] of the whole cloth
    force: Floats
    torque: Floats
    rise: Floats
    climb: Floats
    size: Floats
    residual: Floats
    residual_rms: Floats

    def metrics(self, first: int = 0) -> dict[str, float]:
        """Return means over the steps from `first` on, and shares of these [%] that break an inequality."""
        judged = slice(first, None)
        broken = (self.rise > RISE * self.size)[judged]
        climbed = (self.climb > RISE * self.size)[judged]
        return {
            "conservation/momentum": 100.0 * float(self.force[judged].mean()) / self.weight,
            "conservation/angular": float(self.torque[judged].mean()),
            "conservation/energy": float(np.where(broken, self.rise[judged], 0.0).mean()),
            "conservation/energy_frames": 100.0 * float(broken.mean()),
            "conservation/descent": float(np.where(climbed, self.climb[judged], 0.0).mean()),
            "conservation/descent_frames": 100.0 * float(climbed.mean()),
            "conservation/residual": float(self.residual[judged].mean()),
            "conservation/residual_rms": float(self.residual_rms[judged].mean()),
        }


def law_series(scene: BuiltScene, trajectories: Sequence[Floats]) -> list[LawSeries]:
    """Return the laws of each trajectory, of a scene without pins and of one step a frame.

    Frames are the outer loop, and within a frame first all guesses, then all planes: the obstacle's search
    tree of a frame is made once.

    Args:
        scene: its terms; pins have forces that nobody knows.
        trajectories: positions (T,V,3) [m] each, T at least 3.
    """
    from reference_sim.potential import Potential  # loads numba

    frames = [len(positions) for positions in trajectories]
    potentials = [Potential(copied_terms(scene)) for _ in trajectories]
    # Angular momentum is taken about the pelvis, or the origin where there is no body.
    pivots = np.zeros((scene.frames, 3)) if scene.dressed is None else scene.dressed.pelvis
    numbers: list[list[tuple[float, ...]]] = [[] for _ in trajectories]
    # From the first step on, as a solver: an obstacle's search tree covers what it has been asked about, and
    # where two of its faces are equally near, the tree decides between them.
    for frame in range(1, max(frames, default=0)):
        steps = {k: step_to(scene, x, frame) for k, x in enumerate(trajectories) if frame < frames[k]}
        for k, step in steps.items():
            potentials[k].prepare(step)
            if frame >= FIRST_FULL_FRAME:
                numbers[k].append(
                    _one_step(scene, potentials[k], step, trajectories[k][frame], pivots[frame])
                )
    weight = float(scene.cloth.masses.sum() * GRAVITY)
    return [LawSeries(weight, *np.array(steps).T) for steps in numbers]


def _one_step(
    scene: BuiltScene, potential: Potential, step: Step, x: Floats, pivot: Floats
) -> tuple[float, ...]:
    """Return the numbers of LawSeries for the step that ended at x (V,3) [m]; the potential is prepared."""
    dt, m = scene.dt, scene.cloth.masses
    before, v, after = step.previous, step.velocity, (x - step.previous) / scene.dt
    end = np.ascontiguousarray(x)
    gradient, force = np.zeros_like(end), np.zeros_like(end)
    psi = 0.0
    for term in potential.energies:
        value, slope = term.value_and_gradient(end)
        psi, gradient = psi + value, gradient + slope
        if term.name != "inertia":
            force -= slope
    missing = np.einsum("v,vi->i", m, after - v) - dt * force.sum(axis=0)
    # sum m (x'-p) x v' - sum m (x-p) x v = sum m (x'-p) x (v'-v) - dt sum m v x v'
    turned = np.einsum("v,vi->i", m, np.cross(end - pivot, after) - np.cross(before - pivot, v))
    turned += dt * np.einsum("v,vi->i", m, np.cross(v, after))
    turned -= dt * np.cross(end - pivot, force).sum(axis=0)
    start, first = (potential.value(np.ascontiguousarray(y)) for y in (before, step.guess))
    per_vertex = gradient / (m.mean() * GRAVITY)
    return (
        float(np.linalg.norm(missing)) / dt,
        float(np.linalg.norm(turned)) / dt,
        # |v' - v|_M^2/2 is Psi's inertia at x', |v|_M^2/2 is the same at x.
        psi - start,
        psi - first,
        max(abs(psi), abs(start), abs(first)),
        float(np.abs(per_vertex).max()),
        float(np.sqrt((per_vertex**2).mean())),
    )


def _worst(tolerance: float) -> dict[str, object]:
    return {"table": "", "reference_tolerance": tolerance}


CONSERVATION = Measurements(
    "conservation",
    metrics_of(
        ("conservation/momentum", "% of weight", "Momentum",
         "what is missing from the balance of momentum, mean"),
        ("conservation/angular", "N m", "Angular", "the same of angular momentum about the pelvis"),
        ("conservation/energy_frames", "%", "Energy",
         "frames whose energy rises while contact planes stand still"),
        ("conservation/energy", "J", "Energy rise", "by how much it rises there, mean over all frames"),
        ("conservation/descent_frames", "%", "Descent", "frames that end above the step's first guess"),
        ("conservation/descent", "J", "Above guess", "by how much, mean over all frames"),
        ("conservation/residual", "vertex weights", "Residual",
         "largest component of the gradient left, mean"),
        ("conservation/residual_rms", "vertex weights", "Rms",
         "root mean square of the gradient left, mean"),
        ("conservation/momentum_worst", "weights", "Momentum, worst", CLAIMED, _worst(2e-6)),
        ("conservation/energy_worst", "J", "Energy rise, worst", CLAIMED, _worst(1e-9)),
        ("conservation/residual_worst", "vertex weights", "Residual, worst", CLAIMED, _worst(1e-6)),
        table="conservation", lower_is_better=True,
    ),
    measure=measure,
)  # fmt: skip
