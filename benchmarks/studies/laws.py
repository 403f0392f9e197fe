"""Which physical laws each roll-out on an unseen motion keeps, frame by frame, read from its file.

Rows "law/..." of each method and dressed scene are reported, but of scenes whose garment has pins, for nobody
knows the forces on those, and of motions too short to have a step. Three checks judge the simulation alone,
at its worst frame: it must keep what nobody asks of a network. A run that leaves nothing to read has one
skipped row, which says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..methods import find_method
from ..plan import Cell, Plan, runs
from ..results import Row, RunFolder
from ..study import METHOD as REFERENCE

if TYPE_CHECKING:
    import numpy as np

    from reference_sim import Trajectory

    from ..metrics.laws import LawSeries
    from ..scene import BuiltScene
    from ..wardrobe import Wardrobe

# scene of the row, attribute of LawSeries, unit, how far from zero the reference may be
JUDGED = (
    ("simulation_momentum", "force", "weights", 2e-6),
    ("simulation_energy", "rise", "J", 1e-9),
    ("simulation_residual", "residual", "vertex weights", 1e-6),
)
NOTHING = (
    "this run has no roll-out of three frames or more on a body without pins in the files of suite garments"
)


@dataclass(frozen=True)
class Kept:
    """The laws of a reference roll-out, and which of the steps say that they converged (T - 2,)."""

    laws: LawSeries
    converged: np.ndarray


def rows(plan: Plan, folder: RunFolder, wardrobe: Wardrobe | None) -> list[Row]:
    """Reported rows of every method and dressed scene without pins, then the simulation's judged rows."""
    from ..metrics.energy import FIRST_FULL_FRAME

    found: list[Row] = []
    references: list[Kept] = []
    for scene in (scene for scene in plan.scenes if scene.dressed) if wardrobe is not None else ():
        cells = [c for c in plan.cells if c.scene == scene and runs(c) and has_laws(c.method)]
        paths = [folder.trajectory_path(scene.name, cell.method, cell.seed) for cell in cells]
        if any(path.is_file() for path in paths):
            built = scene.build(plan.preset, wardrobe)
            if not len(built.cloth.pins) and built.frames > FIRST_FULL_FRAME:
                found += _of_scene(built, cells, folder, references)
    if references:
        found += [judged(*check, references) for check in JUDGED]
    return found or [Row("validation", "laws", REFERENCE, 0, "study", "", None, "skipped", NOTHING)]


def has_laws(method: str) -> bool:
    """Methods worth asking: the reference, the free baseline and what was trained."""
    entry = find_method(method)
    network = entry.trained not in (None, "untrained") and not entry.cut_short
    return method in (REFERENCE, "skinning") or network


def _of_scene(scene: BuiltScene, cells: list[Cell], folder: RunFolder, references: list[Kept]) -> list[Row]:
    import numpy as np

    from ..metrics.energy import FIRST_FULL_FRAME
    from ..metrics.laws import UNITS, law_series

    whole = [(cell, t) for cell in cells if (t := _whole(cell, scene, folder)) is not None]
    found = []
    all_laws = law_series(scene, [trajectory.positions for _, trajectory in whole])
    for (cell, trajectory), laws in zip(whole, all_laws):
        for metric, value in laws.metrics().items():
            found.append(
                Row("validation", scene.name, cell.method, cell.seed, metric, UNITS[metric], value,
                    dtype=find_method(cell.method).dtype, terms="+".join(scene.terms))
            )  # fmt: skip
        if cell.method == REFERENCE:
            converged = trajectory.frame_fields.get("converged", np.ones(trajectory.frames))
            references.append(Kept(laws, converged[FIRST_FULL_FRAME:] > 0.5))
    return found


def _whole(cell: Cell, scene: BuiltScene, folder: RunFolder) -> Trajectory | None:
    """The roll-out of a cell, where it came to its end; what did not has its own row in its own suite."""
    import numpy as np

    from reference_sim import Trajectory

    path = folder.trajectory_path(scene.name, cell.method, cell.seed)
    if not path.is_file():
        return None
    trajectory = Trajectory.load(path)
    fine = trajectory.frames == scene.frames and np.isfinite(trajectory.positions).all()
    return trajectory if fine else None


def judged(name: str, attribute: str, unit: str, tolerance: float, references: list[Kept]) -> Row:
    """The worst frame of the simulation. One that says itself that it stalled is an honest stall."""
    import numpy as np

    of_frames = [getattr(kept.laws, attribute) for kept in references]
    if unit == "weights":
        of_frames = [values / kept.laws.weight for values, kept in zip(of_frames, references)]
    value = np.maximum(np.concatenate(of_frames), 0.0)
    bad, converged = value > tolerance, np.concatenate([kept.converged for kept in references])
    status, reason = "ok", ""
    if (bad & converged).any():
        status = "failed"
        reason = f"{int((bad & converged).sum())} frames beyond {tolerance:g} that claim to have converged"
    elif bad.any():
        status, reason = "stalled", f"{int(bad.sum())} of {len(value)} frames, which say so themselves"
    return Row(
        "validation", name, REFERENCE, 0, "check", unit, float(value.max()), status, reason, 0.0, tolerance
    )
