"""The sizes of a run: three frozen presets, from a smoke test to the paper's scale."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Dependence:
    """Sizes of the scenes that vary mesh and time step.

    meshes: numbers of vertices; middle: that at which time steps vary. substeps: time steps a frame.
    """

    meshes: tuple[int, ...]
    middle: int
    substeps: tuple[int, ...]
    frames: int
    settle_frames: int


@dataclass(frozen=True, kw_only=True)
class Preset:
    """The sizes of one run. `None` for a number of motions means all of them.

    frames: at most so many frames of each motion that is measured, at 30 per second, and train_frames of each
    that trains; clip_frames: of its liveliest part;
    warm_up_frames: at the beginning of a dressed scene, simulated and not evaluated, before those of a clip;
    loop_frames: of the walk in a loop.
    steps: optimiser steps per kind of network, or per training. settle_frames: frames from the T-pose into
    the first pose of a motion. sheet_cells: the small scenes are sheets of so many cells along each side.
    gap_samples: frames of a trajectory, at least, at which part speed solves the step again to know the gap
    to its minimum. least_seconds [s]: of run time to be measured of each timed cell, whose short run is done
    again until then. repeats: times that a cell of part speed is run, those whose first run took at most
    repeat_seconds [s]. cell_seconds: time after which the process of a cell is ended [s].
    """

    name: str
    description: str
    garment_vertices: int
    train_motions: int | None
    test_motions: int | None
    frames: int
    train_frames: int
    clip_frames: int
    warm_up_frames: int
    loop_frames: int
    settle_frames: int
    steps: dict[str, int]
    sheet_cells: int
    sheet_frames: int
    gap_samples: int
    least_seconds: float
    repeats: int
    repeat_seconds: float
    cell_seconds: float
    dependence: Dependence

    def steps_of(self, training: str, kind: str) -> int:
        """Return the optimiser steps of a training by its name, else its kind; 0 for an untrained network."""
        return self.steps.get(training, self.steps.get(kind, 0))


def _steps(*, snug: int, ncs: int, **others: int) -> dict[str, int]:
    """Return the optimiser steps per kind: handles are trained as long as snug, ncs-static as ncs."""
    handles = dict.fromkeys(("handles-20", "handles-40", "handles-80", "handles-80-dynamic"), snug)
    once = {"nearest-poses": 1, "pose-regression": 1}
    return {"snug": snug, "ncs": ncs, "ncs-static": ncs, **handles, **once, **others}


PRESETS = (
    Preset(
        name="smoke",
        description="garments of 350 vertices, seconds of training; its numbers mean nothing",
        garment_vertices=350,
        train_motions=1,
        test_motions=1,
        frames=20,
        train_frames=20,
        clip_frames=10,
        warm_up_frames=3,
        loop_frames=390,
        settle_frames=12,
        steps=_steps(snug=60, ncs=30, dynamic=60, supervised=60, pbns=60, santesteban2019=10, tailornet=60),
        sheet_cells=6,
        sheet_frames=10,
        gap_samples=10,
        least_seconds=0.1,
        repeats=2,
        repeat_seconds=0.5,
        cell_seconds=120.0,
        dependence=Dependence((200, 300), 200, (1, 2), 5, 6),
    ),
    Preset(
        name="quick",
        description="garments of 1000 vertices, all training clips, eight motions to measure",
        garment_vertices=1000,
        train_motions=None,
        test_motions=8,
        frames=150,
        train_frames=100_000,
        clip_frames=36,
        warm_up_frames=10,
        loop_frames=10_000,
        settle_frames=30,
        steps=_steps(
            snug=5300,
            ncs=2650,
            dynamic=8000,
            supervised=4000,
            pbns=6000,
            santesteban2019=1000,
            tailornet=4000,
        ),
        sheet_cells=14,
        sheet_frames=45,
        gap_samples=12,
        least_seconds=0.5,
        repeats=3,
        repeat_seconds=1.5,
        cell_seconds=600.0,
        dependence=Dependence((500, 1000, 2000), 1000, (1, 2, 4), 30, 20),
    ),
    Preset(
        name="paper",
        description="garments of 4400 vertices, all frames of all motions, 30,000 steps of SNUG, 136,000 by "
        "the paper's text: hours",
        garment_vertices=4400,
        train_motions=None,
        test_motions=None,
        frames=100_000,
        train_frames=100_000,
        clip_frames=100_000,
        warm_up_frames=10,
        loop_frames=10_000,
        settle_frames=60,
        steps={"snug-paper": 136_000, "pbns-paper": 136_000}
        | _steps(
            snug=30_000,
            ncs=15_000,
            dynamic=30_000,
            supervised=10_000,
            pbns=12_000,
            santesteban2019=10_000,
            tailornet=10_000,
        ),
        sheet_cells=30,
        sheet_frames=90,
        gap_samples=40,
        least_seconds=1.0,
        repeats=3,
        repeat_seconds=120.0,
        cell_seconds=86_400.0,
        dependence=Dependence((500, 1000, 2000, 4400), 1000, (1, 2, 4, 8), 90, 30),
    ),
)


def find_preset(name: str) -> Preset:
    """Return the preset of that name. Raises ValueError naming the choices.

    >>> find_preset("smoke").garment_vertices
    350
    """
    for preset in PRESETS:
        if preset.name == name:
            return preset
    raise ValueError(f"unknown preset '{name}'; choose from {', '.join(p.name for p in PRESETS)}")
