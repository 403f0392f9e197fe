"""Study: everything that is asked of a run, as fields of a TOML file (benchmarks/plan/read_study.py)."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from benchmarks.assets.inputs import FEWEST_FRAMES
from benchmarks.external.roll_out_option import RollOutOption
from benchmarks.presets import Preset, find_preset
from snug.garments.options import GarmentFile
from snug.motion.options import MotionFileOptions

PARTS = ("garments", "speed", "validation", "extremes", "shapes", "fabric", "engines")  # that reports know


class StudyError(ValueError):
    """A field of a study that cannot be meant; the message names its place and what there is instead.

    field: where it was found by the study itself, before its place is known.
    """

    def __init__(self, message: str, field: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.field = field


@dataclass(frozen=True, kw_only=True)
class Part:
    """Scenes that meet methods, and known answers; its name is the column `suite` of its rows.

    A pattern has *, ? or [..]; one that begins with ! takes names out. In scenes, {garment} stands for the
    first garment, {motion} for each measured motion of a scene's garment, {motion 1} for the first of them,
    {swinging 1} for the first of a garment that swings.

    Attributes:
        question: what it answers, one line.
        scenes: names, patterns and files of scenes.
        optional_scenes: those that take part only where field `scenes` of the study names them.
        methods: names, patterns and files of methods.
        optional_methods: those that take part only where field `methods` of the study names them.
        untrained: scenes for which no network is trained unless field `scenes` of the study names them.
        cases: names and patterns of known answers; {smoke} for those marked so, {short} for all but long.
    """

    question: str = ""
    scenes: tuple[str, ...] = ()
    optional_scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    optional_methods: tuple[str, ...] = ()
    untrained: tuple[str, ...] = ()
    cases: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Show:
    """Pictures and films of a published run that the documents show, besides its rows, tables and PDF.

    Attributes:
        pictures: names of figures of the report.
        films: file -> options of reports.film.
    """

    pictures: tuple[str, ...] = ()
    films: Mapping[str, str] = field(default_factory=dict)

    @property
    def files(self) -> tuple[str, ...]:
        """Names of all these files in the folder `figures` of a report."""
        return (*(f"{name}.png" for name in self.pictures), *self.films)


@dataclass(frozen=True, kw_only=True)
class Study:
    """Question, and all that is run to answer it. Each attribute is a field of the file.

    written: the fields as they were read, for run.json.

    Attributes:
        question: what it answers, one line.
        parts: name -> scenes that meet methods.
        sizes: smoke, quick or paper; or a table of changes to one of them, which `base` names.
        scenes: only these: names, patterns, files (mine.py) of scenes; without any all of the parts.
        methods: only these: names, patterns, files (mine.py) of methods; without any all of the parts.
        metrics: files of your own metrics, measured besides all others.
        seeds: seeds of training.
        motions: motion files (.npz, .bvh, .amc with .asf), folders, or the word library (default).
        motion_files: what motion files do not state, and how to take them: up, fps, joint_map, repair.
        test_motions: names of the motions that test; by default those of the library.
        validation_motions: names of the motions that validate; neither these nor those that test train.
        split: which motions are measured: test, or validation, to choose recipes by.
        body: your own body of SMPL's family, .npz or .pkl; garments are made for it.
        garment: your own garment (OBJ, PLY, VTK), made for the body, in place of the T-shirt; or a table:
            path, units, up, shift, rest, uv_scale, material.
        self_contact: whether the cloth of simulations is kept from crossing itself (needs ipctk).
        trained: networks of the package (true), or of the run in a folder, in place of training; methods
            whose network is not there are skipped, those of your own files trained.
        rollouts: name -> file of another program's roll-out, as a method; or a table: path, units, up, fps,
            match_vertices, other_mesh, ms. The path may have {scene}, the scene's name with hyphens for
            slashes.
        device: where networks train, cpu or cuda.
        fabrics: measured fabrics, a CSV of density and bending, for part fabric.
        gauge: a copy of GAUGE-Dataset, whose fabrics part fabric tests too.
        show: pictures and films that the documents show; a study that has it is published.
    """

    question: str = ""
    parts: Mapping[str, Part] = field(default_factory=dict)
    sizes: Preset = field(default_factory=lambda: find_preset("quick"))
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    metrics: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0,)
    motions: tuple[str, ...] = ()
    motion_files: MotionFileOptions = field(default_factory=MotionFileOptions)
    test_motions: tuple[str, ...] = ()
    validation_motions: tuple[str, ...] = ()
    split: Literal["test", "validation"] = "test"
    body: Path | None = None
    garment: GarmentFile | None = None
    self_contact: bool = False
    trained: Path | None = None
    rollouts: Mapping[str, RollOutOption] = field(default_factory=dict)
    device: Literal["cpu", "cuda"] = "cpu"
    fabrics: Path | None = None
    gauge: Path | None = None
    show: Show | None = None
    written: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    origin: Callable[[tuple[str, ...]], str] = field(default=".".join, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.seeds or min(self.seeds) < 0 or max(self.seeds) >= 1 << 63:
            given = ",".join(map(str, self.seeds))[:40]
            wanted = "at least one whole number, none below 0 or beyond 63 bits"
            raise StudyError(f"'{given}': give {wanted}", ("seeds",))
        if self.sizes.frames < FEWEST_FRAMES:
            raise StudyError(f"{self.sizes.frames}: give {FEWEST_FRAMES} or more", ("sizes", "frames"))
        for name in self.parts:
            if name not in PARTS:
                raise StudyError(f"no part is called so; choose from {', '.join(PARTS)}", ("parts", name))

    def place(self, *field: str) -> str:
        """Return where a field was said: a file, its line and the field; or an option."""
        return self.origin(field)


def nearest(word: str, names: Sequence[str], otherwise: str = "see --list") -> str:
    """Return the names that a wrong word may have meant, as the end of a message."""
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else otherwise
