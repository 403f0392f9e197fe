"""Sizes of a run, from a smoke test to the paper's scale: presets.toml, a table each."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path


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

    garment_vertices: about so many has a tailored garment.
    frames: at most so many frames of each motion that is measured, at 30 per second, and train_frames of
    each that trains; clip_frames: of its liveliest part;
    warm_up_frames: at the beginning of a dressed scene, simulated and not evaluated, before those of a
    clip; loop_frames: of the walk in a loop.
    steps: optimiser steps per kind of network, or per training. simulated_mixed: most augmented frames
    that are simulated for each original one, by the method clips_by (empty: that of the training);
    turns: share of a recipe's turns in augmented frames.
    settle_frames: frames from the T-pose into the first pose of a motion. sheet_cells: the small scenes
    are sheets of so many cells along each side, and have sheet_frames frames.
    gap_samples: frames of a trajectory, at least, at which part speed solves the step again to know the
    gap to its minimum. least_seconds [s]: of run time to be measured of each timed cell, whose short run
    is done again until then. repeats: times that a cell of part speed is run, those whose first run took
    at most repeat_seconds [s]. cell_seconds: time after which the process of a cell is ended [s].
    """

    name: str
    description: str
    garment_vertices: int
    train_motions: int | None = None
    test_motions: int | None = None
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
    simulated_mixed: int = 1_000_000
    clips_by: str = ""
    turns: float = 1.0


def _read_presets() -> tuple[Preset, ...]:
    tables = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    for table in tables.values():
        sizes = table["dependence"]
        sizes |= {name: tuple(sizes[name]) for name in ("meshes", "substeps")}
        table["dependence"] = Dependence(**sizes)
    return tuple(Preset(name=name, **table) for name, table in tables.items())


PRESETS = _read_presets()


def find_preset(name: str) -> Preset:
    """Return the preset of that name. Raises ValueError naming the choices.

    >>> find_preset("smoke").garment_vertices
    350
    """
    presets = {preset.name: preset for preset in PRESETS}
    if name not in presets:
        raise ValueError(f"unknown preset '{name}'; choose from {', '.join(presets)}")
    return presets[name]
