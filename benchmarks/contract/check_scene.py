"""Check of a scene: whether it keeps the contract of benchmarks.scene, and its energies their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from benchmarks.assets.inputs import FEWEST_FRAMES
from benchmarks.cell import TaskId
from benchmarks.contract.findings import Findings, altered, fingerprints
from benchmarks.methods.catalogue.all_methods import find_method
from benchmarks.scene import BuiltScene, Scene
from benchmarks.tasks.task import Context, Outcome, Task

if TYPE_CHECKING:
    from benchmarks.assets.assets import Assets
    from reference_sim.energies import Energy

DISPLACEMENT = 0.02  # of the mean edge, for the places at which derivatives are compared
DIFFERENCE_STEP = 1e-6  # [m] of central differences: their error is some 1e-7 of the derivative
DERIVATIVE_TOLERANCE = 1e-4  # of the norm of the gradient, of the Hessian's largest entry
SUM_ROUND_OFF = 1e-13  # of a sum of many terms, as a share of it
DIRECTIONS = 3  # along which derivatives are compared


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckScene(Task):
    """Build a scene twice, look at its parts, and simulate it; the findings are in the result."""

    kind = "check"
    stage = "check"
    scene: Scene

    def assets(self, assets: Assets | None) -> Assets | None:
        """Return the assets with the motion of the scene alone."""
        return assets.only(self.scene.motion) if assets is not None and self.scene.dressed else None

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Check, and return the findings as the result."""
        findings = Findings(self.scene.declared_in or self.scene.module)
        return findings.look(lambda: self._check(findings, context))

    def _check(self, findings: Findings, context: Context) -> None:
        with findings.call("build()", ": it is called as build(scene, assets, **sizes and options)"):
            scene, again = (self.scene.build(context.assets) for _ in range(2))
        if not findings.demand(
            isinstance(scene, BuiltScene), f"build() gives a {type(scene).__name__}: return a BuiltScene"
        ):
            return
        self._check_parts(findings, scene)
        if findings.wrong:
            return
        with findings.call("settle()"):
            before = fingerprints(scene)
            other = altered(before, again)
        findings.demand(
            not other, f"is built otherwise the second time: {other}: fix the seed of all that is random"
        )
        users = [e for e in scene.energies if not type(e).__module__.startswith("reference_sim.")]
        for energy in users:
            with findings.call(f"energy {energy.name}"):
                check_derivatives(findings, energy, scene)
        if findings.wrong:
            return
        with findings.call("its simulation"):
            simulation = find_method("simulation").make(models=context.folder.models, seed=0)
            simulation.prepare(scene)
            trajectory = simulation.run()
        if trajectory.status != "converged":
            findings.notes.append(f"its simulation ends as {trajectory.status}: {trajectory.reason}")

    def _check_parts(self, findings: Findings, scene: BuiltScene) -> None:
        import numpy as np

        declared, vertices = self.scene, scene.cloth.vertex_count
        findings.demand(scene.name == declared.name, f"is built as '{scene.name}': give name=scene.name")
        findings.demand(
            scene.frames >= FEWEST_FRAMES, f"has {scene.frames} frames: at least {FEWEST_FRAMES} are needed"
        )
        findings.demand(
            bool(scene.energies), "declares no energies: without one there is nothing to minimise"
        )
        for energy in scene.energies:
            findings.demand(
                energy.cloth is scene.cloth, f"energy {energy.name} is made of another cloth: use the scene's"
            )
        findings.demand(
            (scene.obstacle is not None) == (declared.obstacle or declared.dressed),
            "builds an obstacle and declares none, or the reverse: say obstacle=True where it has one",
        )
        findings.demand(
            (scene.dressed is not None) == declared.dressed,
            "is built dressed and names no garment, or the reverse: say garment= and motion= where it is",
        )
        with findings.call("settle()"):
            start = np.asarray(scene.settle(), dtype=np.float64)
        findings.demand(
            start.shape in ((vertices, 3), (2, vertices, 3)) and bool(np.isfinite(start).all()),
            f"settle() gives {start.shape}: finite positions {(vertices, 3)} [m], or these and velocities",
        )
        if scene.pin_positions is not None:
            pins = (len(scene.cloth.pins), 3)
            for frame in (0, scene.frames - 1):
                with findings.call(f"pin_positions({frame})"):
                    place = np.shape(scene.pin_positions(frame))
                findings.demand(
                    place == pins, f"pin_positions({frame}) gives {place}: one place for each pin is {pins}"
                )
        if scene.exact is not None:
            shape = (scene.frames, vertices, 3)
            findings.demand(
                np.shape(scene.exact) == shape, f"exact is {np.shape(scene.exact)}, expected {shape}"
            )


def check_derivatives(findings: Findings, energy: Energy, scene: BuiltScene) -> None:
    """Gradient and Hessian against central differences of value and gradient."""
    import numpy as np

    from reference_sim import Potential
    from reference_sim.energies import Energy, Step

    cloth, random = scene.cloth, np.random.default_rng(0)
    edges = cloth.edges
    length = float(np.linalg.norm(scene.start[edges[:, 0]] - scene.start[edges[:, 1]], axis=1).mean())
    x = scene.start + DISPLACEMENT * length * random.standard_normal(scene.start.shape)
    energy.prepare(Step(scene.start, scene.start_velocity, x, scene.dt, scene.obstacle, 1))
    value, gradient = energy.value_and_gradient(x)
    what = f"energy {energy.name}: its"
    if not findings.demand(
        bool(np.isfinite(value)) and np.shape(gradient) == x.shape and bool(np.isfinite(gradient).all()),
        f"{what} value {value} and gradient {np.shape(gradient)}: expected a finite number and {x.shape}",
    ):
        return
    moved = np.abs(gradient).max(axis=1) > 0.0  # elsewhere any direction says the same
    for _ in range(DIRECTIONS):
        direction = random.standard_normal(x.shape) * (moved[:, None] if moved.any() else 1.0)
        ahead, behind = (
            energy.value_and_gradient(x + sign * DIFFERENCE_STEP * direction) for sign in (1.0, -1.0)
        )
        slope, stated = (ahead[0] - behind[0]) / (2.0 * DIFFERENCE_STEP), float((gradient * direction).sum())
        findings.demand(
            bool(
                abs(slope - stated)
                <= DERIVATIVE_TOLERANCE * np.linalg.norm(gradient)
                + SUM_ROUND_OFF * abs(value) / DIFFERENCE_STEP
            ),
            f"{what} gradient is not the derivative of its value: {stated:.6g} N along a direction, "
            f"differences say {slope:.6g} N",
        )
    turned = (ahead[1] - behind[1]) / (2.0 * DIFFERENCE_STEP)
    if type(energy).add_hessian is Energy.add_hessian and not energy.dynamic:
        blocks = energy.active_hessian_blocks(x)[1]  # the solver reads one half of them
        findings.demand(
            np.abs(blocks - blocks.swapaxes(1, 2)).max(initial=0.0) <= 1e-9 * np.abs(blocks).max(initial=0.0),
            f"{what} Hessian is not symmetric; leave it to automatic differentiation, or mend it",
        )
    product = (Potential([energy]).hessian(x) @ direction.ravel()).reshape(x.shape)
    off, most = float(np.abs(turned - product).max()), float(np.abs(turned).max())
    findings.demand(
        off
        <= DERIVATIVE_TOLERANCE * max(most, float(np.abs(product).max()))
        + SUM_ROUND_OFF * np.abs(gradient).max() / DIFFERENCE_STEP,
        f"{what} Hessian is not the derivative of its gradient: off by {off:.3g} of {most:.3g} N/m; leave it "
        "to automatic differentiation, or mend it",
    )
