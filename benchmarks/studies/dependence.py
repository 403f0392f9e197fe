"""How much of every headline number is the mesh's or the time step's.

The T-shirt in the first frames of one training motion, tailored and simulated at several sizes with one time
step, and at one size with several. Beside the simulation stand skinning and a solver stopped after one
iteration a step, each against the simulation on the same mesh at the same time step. Rows are reported,
never judged: numbers of two meshes are two definitions of the energy, of contact and of curvature.

Scenes "dependence/mesh/<vertices asked for>", at one step a frame, and "dependence/dt/<steps a second>" on
the middle mesh.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..plan import Plan
from ..results import Row, RunFolder

if TYPE_CHECKING:
    from reference_sim import Trajectory

    from ..presets import Preset
    from ..scene import BuiltScene
    from ..wardrobe import Wardrobe
    from ..workers import Tell

MOTION = "walk"  # a training motion: nothing here looks at those that methods are compared on
CUT = "newton-1"  # the solver that is stopped
FRAME_RATE = 30
UNITS = {"energy": "J", "curvature": "1/m", "penetration": "%", "mesh/vertices": "1", "mesh/edge": "mm"}


@dataclass(frozen=True)
class Sizes:
    """Of one preset: meshes [vertices asked for], the one at which time steps vary, and how long [frames]."""

    meshes: tuple[int, ...]
    middle: int
    substeps: tuple[int, ...]
    frames: int
    settle_frames: int


SIZES = {
    "smoke": Sizes((200, 300), 200, (1, 2), 5, 6),
    "quick": Sizes((500, 1000, 2000), 1000, (1, 2, 4), 30, 20),
    "paper": Sizes((500, 1000, 2000, 4400), 1000, (1, 2, 4, 8), 90, 30),
}


def rows(plan: Plan, folder: RunFolder, wardrobe: Wardrobe | None) -> list[Row]:
    """All meshes and time steps, some at a time; the wardrobe of the run is not looked at."""
    from ..workers import Failure, Job, run_jobs

    sizes = SIZES[plan.preset.name]
    preset = dataclasses.replace(plan.preset, frames=sizes.frames, settle_frames=sizes.settle_frames)
    others = [n for n in sizes.meshes if n != sizes.middle]
    todo: list[tuple[str, int, tuple[int, ...]]] = [(f"mesh/{n}", n, (1,)) for n in others]
    todo.append((f"mesh/{sizes.middle}", sizes.middle, sizes.substeps))
    jobs = [
        Job(
            name,
            of_one_mesh,
            (dataclasses.replace(preset, garment_vertices=n), steps, plan.body_file),
            n * sum(steps),
        )
        for name, n, steps in sorted(todo, key=lambda job: -job[1] * sum(job[2]))
    ]
    found: list[Row] = []
    ended = run_jobs(jobs, wardrobe, title="dependence", unit="vertex", workers=plan.workers)
    for job, result in zip(jobs, ended):
        if isinstance(result, Failure):
            scene, reason = f"dependence/{job.label}", result.reason
            found.append(Row("validation", scene, "simulation", 0, "study", "", None, "failed", reason))
        else:
            found += result
    places = {f"dependence/mesh/{n}": n for n in sizes.meshes}
    return sorted(found, key=lambda row: places.get(row.scene, FRAME_RATE * 10_000))


def of_one_mesh(
    wardrobe: Wardrobe | None,
    tell: Tell,
    preset: Preset,
    all_substeps: tuple[int, ...],
    body: Path | None = None,
) -> list[Row]:
    """The rows of the T-shirt of preset.garment_vertices, at each number of steps a frame."""
    from ..scenes import dressed_scene
    from ..wardrobe import embedded_motions, open_wardrobe

    own = open_wardrobe(preset, embedded_motions([MOTION]), body=body)
    scene = dressed_scene(MOTION).build(preset, own)
    start = scene.start
    scene = dataclasses.replace(scene, settle=lambda: start)
    found = []
    for substeps in all_substeps:
        measured = measure(scene, substeps)
        tell(preset.garment_vertices * substeps)
        variant = f"mesh/{preset.garment_vertices}" if substeps == 1 else f"dt/{FRAME_RATE * substeps}"
        found += _rows(f"dependence/{variant}", scene, measured)
    return found


def measure(scene: BuiltScene, substeps: int) -> dict[str, dict[str, float]]:
    """The headline metrics of each method. Raises RuntimeError where the reference does not converge."""
    from ..methods import find_method
    from ..metrics.curvature import curvature_error, curvature_series
    from ..metrics.energy import energy_series, mean_energy
    from ..metrics.geometry import penetration

    skinning = find_method("skinning").make(models=Path(), seed=0)
    skinning.prepare(scene)
    trajectories = {
        "simulation": _simulated(scene, substeps=substeps),
        "skinning": skinning.run(),
        CUT: _simulated(scene, substeps=substeps, method="newton", max_iterations=1),
    }
    reference = trajectories["simulation"]
    if reference.frames < scene.frames or reference.status == "diverged":
        raise RuntimeError(f"the simulation ended as {reference.status}: {reference.reason}")
    positions = [trajectory.positions for trajectory in trajectories.values()]
    curvatures = [curvature_series(x, scene.cloth.faces) for x in positions]
    assert scene.obstacle is not None
    inside = penetration(positions, scene.obstacle)
    found = {}
    for k, (method, energies) in enumerate(zip(trajectories, energy_series(scene, positions))):
        metrics = {f"energy/{term}": mean_energy(series) for term, series in energies.items()}
        metrics["curvature/mean"] = float(curvatures[k].means().mean())
        if method != "simulation":
            metrics["curvature/error"] = float(curvature_error(curvatures[k], curvatures[0]).mean())
        metrics["penetration/vertices"] = 100.0 * float(inside[k].share.mean())
        found[method] = metrics
    found["simulation"]["mesh/vertices"] = float(scene.cloth.vertex_count)
    found["simulation"]["mesh/edge"] = 1e3 * float(scene.cloth.edge_lengths.mean())
    return found


def _simulated(scene: BuiltScene, **options: Any) -> Trajectory:
    from reference_sim import simulate

    return simulate(
        scene.cloth, scene.energies, dt=scene.dt, frames=scene.frames, obstacle=scene.obstacle,
        start=scene.start, **options,
    )  # fmt: skip


def _rows(name: str, scene: BuiltScene, measured: dict[str, dict[str, float]]) -> list[Row]:
    terms = "+".join(scene.terms)
    return [
        Row("validation", name, method, 0, metric, _unit(metric), value, terms=terms)
        for method, metrics in measured.items()
        for metric, value in metrics.items()
    ]


def _unit(metric: str) -> str:
    return UNITS.get(metric) or UNITS[metric.partition("/")[0]]
