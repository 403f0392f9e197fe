"""Tables of the studies: laws of roll-outs, what depends on mesh and time step, and hard motions."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.results import CLIP, Row
from reports.summary import Measurements, dressed_scenes, suite_rows
from reports.table import Cell, Column, Table

LAWS = {
    "law/momentum": Column("momentum", "Momentum", "% of weight"),
    "law/angular": Column("angular", "Angular", "N m"),
    "law/energy_frames": Column("energy_frames", "Energy", "% of frames"),
    "law/energy": Column("energy", "Energy rise", "J"),
    "law/descent_frames": Column("descent_frames", "Descent", "% of frames"),
    "law/descent": Column("descent", "Above guess", "J"),
    "law/residual": Column("residual", "Residual", "weights"),
    "law/residual_rms": Column("residual_rms", "Rms", "weights"),
}
DEPENDENCE = {
    "energy/strain": Column("strain", "Strain", "J"),
    "energy/bending": Column("bending", "Bending", "J"),
    "energy/gravity": Column("gravity", "Gravity", "J"),
    "energy/inertia": Column("inertia", "Inertia", "J"),
    "energy/collision": Column("collision", "Collision", "J"),
    "curvature/mean": Column("curvature", "Mean curvature", "1/m"),
    "curvature/error": Column("curvature_error", "Its error", "1/m"),
    "penetration/vertices": Column("penetration", "Below skin", "%"),
}
MOTIONS = {
    "motion/strain": Column("strain", "Worst strain", "J"),
    "motion/strain_ratio": Column("strain_ratio", "Over ordinary"),
    "motion/offset": Column("offset", "Farthest", "mm"),
    "motion/penetration": Column("penetration", "Below skin", "%"),
}
AFTERMATH = {
    "motion/recovery_1": Column("recovery_1", "1 frame after", "mm"),
    "motion/recovery_10": Column("recovery_10", "10 frames", "mm"),
    "motion/recovery_30": Column("recovery_30", "30 frames", "mm"),
    "motion/drift": Column("drift", "Drift", "mm"),
    "motion/total": Column("total", "Total energy", "J"),
}
CAPTIONS = {
    "laws": "Laws of a time step, mean over frames, then over unseen motions: what is missing from the "
    "balance of momentum, and of angular momentum about the pelvis; frames whose energy rises while contact "
    "planes stand still, and by how much; frames that end above the step's first guess, which costs nothing; "
    "the gradient left, largest and root mean square.",
    "dependence": "The same garment in the same frames of a training motion, on other meshes and with "
    "smaller time steps: no number of this report may be compared with one from another mesh or time step.",
    "hard_motions": "Motions, shapes, glitches and materials that nothing was trained on: the worst strain "
    "of a frame, and over the same method's worst on the ordinary walk; the farthest that a vertex came from "
    "the skinned shirt.",
    "hard_aftermath": "After a glitch of one frame, the distance to the roll-out without it; over a loop of "
    "10,000 frames, the drift; of another material, the mean total energy of a frame by that material.",
}
GROUPED = {"dependence": ("variant",), "hard_motions": ("case",), "hard_aftermath": ("case",)}


def laws(rows: Sequence[Row]) -> Table | None:
    """What each method leaves undone of the laws of a time step, mean over the dressed scenes."""
    measured = law_measurements(rows)
    lines: list[tuple[Cell, ...]] = [
        (method, *(measured.mean(method, metric) for metric in LAWS))
        for method in measured.methods
        if measured.mean(method, "law/residual") is not None
    ]
    return _table("laws", (Column("method", "Method"), *LAWS.values()), lines)


def law_measurements(rows: Sequence[Row]) -> Measurements:
    """The laws in the scenes to take means over: no clip whose whole motion is among them."""
    kept = [row for row in suite_rows(rows, "validation") if row.metric.startswith("law/")]
    measured = Measurements(kept)
    scenes = dressed_scenes(measured)
    return measured.only(s for s in scenes if not (s.endswith(CLIP) and s.removesuffix(CLIP) in scenes))


def dependence(rows: Sequence[Row]) -> Table | None:
    """Headline numbers of one garment and motion on several meshes and at several time steps."""
    kept = [row for row in suite_rows(rows, "validation") if row.scene.startswith("dependence/")]
    measured = Measurements(kept)
    lines: list[tuple[Cell, ...]] = []
    for scene in measured.scenes:
        for method in measured.methods:
            means = [measured.mean(method, metric, [scene]) for metric in DEPENDENCE]
            if any(mean is not None for mean in means):
                lines.append((_variant(measured, scene), method, *means))
    return _table(
        "dependence", (Column("variant", ""), Column("method", "Method"), *DEPENDENCE.values()), lines
    )


def _variant(measured: Measurements, scene: str) -> str:
    """As "1002 vertices, 1/60 s"."""
    _, kind, size = scene.split("/")
    vertices = measured.value("simulation", "mesh/vertices", [scene])
    mesh = f"{int(vertices)} vertices" if vertices is not None else scene
    return f"{mesh}, 1/{size if kind == 'dt' else 30} s"


def hard_motions(rows: Sequence[Row]) -> Table | None:
    """How each network, skinning and the simulator went through each hard motion."""
    lines: list[tuple[Cell, ...]] = []
    for case, method, own in _hard_cells(rows):
        values = {row.metric: row.value for row in own}
        lines.append((case, method, _ended(own[0]), *(values.get(metric) for metric in MOTIONS)))
    head = (Column("case", "Case"), Column("method", "Method"), Column("outcome", "Outcome"))
    return _table("hard_motions", (*head, *MOTIONS.values()), lines)


def hard_aftermath(rows: Sequence[Row]) -> Table | None:
    """What is left of a glitch, of a long roll-out, and under another material."""
    lines: list[tuple[Cell, ...]] = []
    for case, method, own in _hard_cells(rows):
        values = {row.metric: row.value for row in own}
        if any(metric in values for metric in AFTERMATH):
            lines.append((case, method, *(values.get(metric) for metric in AFTERMATH)))
    head = (Column("case", "Case"), Column("method", "Method"))
    return _table("hard_aftermath", (*head, *AFTERMATH.values()), lines)


def _hard_cells(rows: Sequence[Row]) -> list[tuple[str, str, list[Row]]]:
    """Case, method and rows of everybody's way through every hard motion, one for each seed."""
    cells: dict[tuple[str, str, int], list[Row]] = {}
    for row in suite_rows(rows, "extremes"):
        if row.metric.startswith("motion/") and row.status != "skipped":
            cells.setdefault((row.scene, row.method, row.seed), []).append(row)
    return [(scene.partition("/")[2], method, own) for (scene, method, _), own in cells.items()]


def _ended(row: Row) -> str:
    """A network that ends well did not converge, it stayed within bounds."""
    if row.status != "ok":
        return row.status
    return "converged" if row.method == "simulation" else "bounded"


def _table(name: str, columns: tuple[Column, ...], lines: list[tuple[Cell, ...]]) -> Table | None:
    return Table(name, columns, tuple(lines)) if lines else None
