"""The plan of a run: all that it will do, decided and checked before anything is created."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.assets import Inputs
from benchmarks.external.roll_out_files import MODULE as STORED
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.plan.cell import Cell, TaskId
from benchmarks.plan.motions import Motions
from benchmarks.plan.study import StudyError
from benchmarks.presets import Preset, find_preset
from benchmarks.results.protocol import NUMBER, OWN
from benchmarks.scene import Scene
from benchmarks.scenes import all_scenes
from benchmarks.training import Training

if TYPE_CHECKING:
    from benchmarks.assets import Assets
    from benchmarks.validation.case import Case


@dataclass(frozen=True)
class Network:
    """A network that some cell needs: its name, its seed, the garment it is for.

    users_training: of a method in a user's file, which is declared_in.
    """

    name: str
    seed: int
    garment: str
    users_training: Training | None = None
    declared_in: str = ""

    @property
    def label(self) -> str:
        """Name, seed and garment, for people."""
        return f"{self.name} seed {self.seed} ({self.garment})"

    @property
    def task_id(self) -> TaskId:
        """Id of the task that trains it."""
        return "network", f"{self.garment}/{self.name}-seed{self.seed}"

    @property
    def training(self) -> Training | None:
        """The training; None: an untrained network."""
        return self.users_training or TRAININGS.get(self.name)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Everything to be done.

    inputs: the user's files, as read. retry: whether tasks that have failed are done again; fresh: all that
    the folder holds is forgotten first. workers: processes side by side where nothing is timed.
    metrics: modules of metrics that are not the project's, see benchmarks.plan.user_files. scheduler: address
    of a cluster that does what is not timed; empty: this machine does. trained: folder whose networks take
    the place of trainings; None: networks are trained. study: what was asked, as written. Raises StudyError
    where two cells have the files of one: slashes of names become hyphens there.
    """

    preset: Preset
    cells: tuple[Cell, ...]
    suites: tuple[str, ...] = ("speed",)
    cases: tuple[Case, ...] = ()
    metrics: tuple[str, ...] = ()
    motions: Motions = field(default_factory=Motions)
    inputs: Inputs = field(default_factory=Inputs)
    seeds: tuple[int, ...] = (0,)
    device: str = "cpu"
    folder: Path = Path()
    command: str = ""
    retry: bool = False
    fresh: bool = False
    workers: int = 1
    scheduler: str = ""
    trained: Path | None = None
    study: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        cell_of: dict[str, Cell] = {}
        for cell in self.cells:
            if (other := cell_of.setdefault(cell.name, cell)) is not cell:
                raise StudyError(f"{cell.label} and {other.label} would have the same files: rename one")

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scenes of all cells, each once."""
        return tuple({cell.scene.name: cell.scene for cell in self.cells}.values())

    @property
    def networks(self) -> tuple[Network, ...]:
        """Every network that some cell needs."""
        return tuple(dict.fromkeys(filter(None, map(network_of, self.cells))))

    @property
    def garments(self) -> tuple[str, ...]:
        """The garments of the plan's scenes, each once."""
        return tuple(dict.fromkeys(cell.scene.garment for cell in self.cells if cell.scene.dressed))

    @property
    def cut_motions(self) -> dict[str, str]:
        """Motion of a user's file -> which of its frames are measured, where these are not all."""
        most = self.preset.frames
        return {
            name: f"the first {most} of {motion.frames} frames"
            for name, motion in self.inputs.motions.items()
            if name in self.motions.measured and motion.frames > most
        }

    def open_assets(self) -> Assets:
        """Make body, garments and motions of the scenes. Raises ValueError where one cannot be made."""
        from benchmarks.assets import embedded_motions, open_assets  # loads numpy

        read, train = self.inputs.motions, self.motions.train
        names = [scene.motion for scene in self.scenes if scene.dressed]
        for garment in self.garments:
            names += self.motions.measured_of(garment)
        names += train if self.networks else ()
        wanted = dict.fromkeys(names)
        motions = [read[name] for name in wanted if name in read]
        motions += embedded_motions(name for name in wanted if name not in read)
        return open_assets(self.preset, motions, self.garments, inputs=self.inputs, training=train)


def runs(cell: Cell) -> bool:
    """Return whether the cell is computed at all."""
    return cell.entry.skip(cell.scene) is None


def network_of(cell: Cell) -> Network | None:
    """Return the network that a cell needs, where it is computed at all."""
    entry = cell.entry
    if not entry.trained or not runs(cell):
        return None
    home = entry.declared_in if entry.training else ""
    return Network(entry.trained, cell.seed, cell.scene.garment, entry.training, home)


def protocol_of(cell: Cell, plan: Plan) -> str:
    """Return the protocol of a cell's rows: its number, or OWN where scene or settings are a user's.

    Settings are the preset, the body, the garment with its material, the motion, the reference, and what the
    project's own networks train on.
    """
    scene, inputs = cell.scene, plan.inputs
    given = scene.dressed and (inputs.body or scene.motion in inputs.motions)
    if given or plan.preset != find_preset(plan.preset.name) or not _is_declared(scene, plan.preset.name):
        return OWN
    if any(c.entry.role == "reference" and c.entry.module == STORED for c in plan.cells if c.scene == scene):
        return OWN
    network = network_of(cell)
    if network is None or network.users_training:
        return NUMBER
    from snug.motion.library import TRAIN

    trained_on = TRAIN[: plan.preset.train_motions]
    return NUMBER if plan.motions.train == trained_on and not inputs.motions else OWN


def protocol_of_case(scene: str, metric: str) -> str:
    """Return the protocol of a row that no cell gives: OWN of a case that is not the project's."""
    return NUMBER if {scene, (scene, metric)} & _places() else OWN


@cache
def _places() -> frozenset[Any]:
    from benchmarks.validation.registry import CASES

    return frozenset({case.name for case in CASES} | {(case.scene, case.metric) for case in CASES})


_declared_with = cache(all_scenes)  # motions and swinging motions


def _is_declared(scene: Scene, preset: str) -> bool:
    """Return whether the project declares the scene so; a run may leave out what is measured in it."""
    motions = (scene.motion,) * bool(scene.motion)
    declared = _declared_with(motions, motions).get(scene.name)
    return declared is not None and replace(declared.at(find_preset(preset)), metrics=scene.metrics) == scene
