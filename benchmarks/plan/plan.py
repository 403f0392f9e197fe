"""The plan of a run: all that it will do, decided and checked before anything is created."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.assets import Assets, Inputs, make_motions, open_assets, read_inputs
from benchmarks.declarations import by_name
from benchmarks.external.roll_out_files import MODULE as STORED
from benchmarks.method import Training, is_installed
from benchmarks.methods import METHODS
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.metrics import list_metrics
from benchmarks.plan import user_files
from benchmarks.plan.cell import Cell, TaskId
from benchmarks.plan.choose_cells import ReadStudy, choose_cells
from benchmarks.plan.motions import Motions, split_motions
from benchmarks.plan.study import Study, StudyError, nearest
from benchmarks.presets import find_preset
from benchmarks.provenance import usable_cores
from benchmarks.results.protocol import NUMBER, OWN
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from benchmarks.scene import Scene
from benchmarks.scenes import GarmentScenes, all_scenes
from benchmarks.validation.case import Case
from benchmarks.validation.registry import CASES
from reference_sim.files.atomic_files import demand_writable_folder
from snug.kinds import KINDS
from snug.motion.library import TRAIN


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
    def training(self) -> Training:
        """The training, as declared."""
        return self.users_training or TRAININGS[self.name]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Everything to be done.

    metrics: modules of metrics not the project's, see benchmarks.plan.user_files. inputs: the
    user's files, as read. retry: whether tasks that have failed are done again; fresh: all that the
    folder holds is forgotten first. workers: processes side by side where nothing is timed. Raises
    StudyError where two cells have the files of one: slashes of names become hyphens there.
    """

    study: Study
    cells: tuple[Cell, ...]
    cases: tuple[Case, ...] = ()
    metrics: tuple[str, ...] = ()
    motions: Motions = field(default_factory=Motions)
    inputs: Inputs = field(default_factory=Inputs)
    folder: Path = Path()
    command: str = ""
    retry: bool = False
    fresh: bool = False
    workers: int = 1

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
        """Motion of a user's file -> which of its frames are measured, if not all."""
        limit = self.study.sizes.frames
        return {
            name: f"the first {limit} of {motion.frames} frames"
            for name, motion in self.inputs.motions.items()
            if name in self.motions.measured and motion.frames > limit
        }

    def open_assets(self) -> Assets:
        """Make body, garments and all motions of a run. Raises ValueError."""
        train = self.motions.train
        names = [name for garment in self.garments for name in self.motions.pick_motions(garment)]
        return self.open_some([*names, *(train if self.networks else ())], training=train)

    def open_some(self, motions: Sequence[str] = (), **fields: Any) -> Assets:
        """Make body, garments and motions of the scenes, and `motions`; fields: of `open_assets`."""
        user_motions = self.inputs.motions
        names = dict.fromkeys([*(scene.motion for scene in self.scenes if scene.dressed), *motions])
        made = [user_motions[name] for name in names if name in user_motions]
        made += make_motions(name for name in names if name not in user_motions)
        return open_assets(self.study.sizes, made, self.garments, inputs=self.inputs, **fields)


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
    """Return the protocol of a cell's rows: NUMBER, or OWN where scene or settings are a user's.

    Settings: preset, body, garment with its material, motion, reference, and what our networks train on.
    """
    scene, inputs, sizes = cell.scene, plan.inputs, plan.study.sizes
    from_user = scene.dressed and (inputs.body or scene.motion in inputs.motions)
    if from_user or sizes != find_preset(sizes.name) or not _is_declared(scene, sizes.name):
        return OWN
    entries = (c.entry for c in plan.cells if c.scene == scene)
    if any(entry.role == "reference" and entry.module == STORED for entry in entries):
        return OWN
    network = network_of(cell)
    if network is None or network.users_training:
        return NUMBER
    trained_on = TRAIN[: sizes.train_motions]
    return NUMBER if plan.motions.train == trained_on and not inputs.motions else OWN


def protocol_of_case(scene: str, metric: str) -> str:
    """Return the protocol of a row of a case: OWN where it is a user's."""
    listed = any(scene == case.name or (scene, metric) == (case.scene, case.metric) for case in CASES)
    return NUMBER if listed else OWN


_declared_with = cache(all_scenes)  # motions and swinging motions


def _is_declared(scene: Scene, preset: str) -> bool:
    """Return whether the project declares the scene so, but for what is measured in it."""
    motions = (scene.motion,) * bool(scene.motion)
    ours = _declared_with(motions, motions).get(scene.name)
    return ours is not None and replace(ours.at(find_preset(preset)), metrics=scene.metrics) == scene


# everywhere, so that seconds of two runs can be compared; fewer where cores are fewer
WORKERS = 2


def make_plan(
    study: Study,
    *,
    folder: Path | None = None,
    workers: int | None = None,
    scenes: Sequence[Scene] = (),
    **fields: Any,
) -> Plan:
    """Return the plan of a study: cells, cases, motions and a user's inputs as read.

    All else is as of a Plan; without a folder it is a new one, without workers as many as usual. `scenes`
    are further ones that no file declares.

    Raises:
        ValueError: one line for the first thing that cannot be met, with a remedy; nothing is created.

    >>> from benchmarks.plan.study import option, read_study
    >>> study = read_study("full", [option("scenes", "flag"), option("methods", "simulation")])
    >>> [scene.name for scene in make_plan(study).scenes]
    ['flag']
    """
    folder = choose_folder(folder)
    check_machine(study, folder)
    workers = min(WORKERS, usable_cores()) if workers is None else workers
    if workers < 1:
        raise StudyError(f"--workers {workers}: give a whole number, 1 or more")
    scope = read_files(study, scenes)
    cells, cases = choose_cells(scope)
    return Plan(
        study=study,
        cells=cells,
        cases=cases,
        metrics=choose_metrics(study),
        motions=scope.motions,
        inputs=scope.inputs,
        folder=folder,
        workers=workers,
        **fields,
    )


def read_files(study: Study, scenes: Sequence[Scene] = ()) -> ReadStudy:
    """Read all files of a user that a study names; `scenes` are further ones.

    Raises:
        ValueError: one line for the first file that cannot be read or named.
    """
    study, user_scenes, user_methods, user_cases = user_files.declarations_of(study)
    garment, self_contact = study.garment, study.self_contact
    if garment and garment.name in {name.split("/")[0] for name in all_scenes("-", "-")}:
        raise StudyError(f"{garment.path}: the project has scenes of that name: give the file another")
    if self_contact and not is_installed("ipctk"):
        raise StudyError("self_contact: needs the package ipctk: pip install ipctk")
    networks = [*TRAININGS, *KINDS, *(entry.trained for entry in user_methods if entry.trained)]
    for name in study.sizes.steps:
        if name not in networks:
            raise StudyError(f"sizes.steps.{name}: no training is called so; {nearest(name, networks)}")
    inputs = read_inputs(study.body, garment, study.motions, study.motion_files)
    motions = split_motions(study, inputs.motions)
    of_file = [GarmentScenes(garment.name, f"a garment of {garment.path.name}")] if garment else []
    garments = (*of_file, *motions.garments[len(of_file) :])  # in place of the T-shirt
    garments = tuple(replace(w, self_contact=self_contact) for w in garments)
    motions = replace(motions, garments=garments)
    roles, dynamic = motions.roles(), motions.roles(dynamic=True)
    measured = all_scenes(
        dict.fromkeys((*motions.measured, *roles["test"], *roles["validation"])),
        (*dynamic["test"], *dynamic["validation"]),
        motions.garments,
    )
    scene_of = by_name("scene", (*measured.values(), *scenes, *user_scenes))
    methods = by_name("method", (*METHODS, *user_methods))
    cases = by_name("known answer", (*CASES, *user_cases))
    return ReadStudy(study, inputs, motions, scene_of, methods, tuple(cases.values()))


def choose_metrics(study: Study) -> tuple[str, ...]:
    """Return the modules of metrics not the project's. Raises ValueError."""
    names, metrics = user_files.resolve(user_files.METRICS, study.metrics)
    for name in set(names) - {metric.name for metric in metrics}:
        raise StudyError(f"metrics: {name}: is no file; those of the project are measured without it")
    homes = tuple(dict.fromkeys(metric.declared_in for metric in metrics))
    list_metrics(homes)  # each name stands once
    return homes


def check_machine(study: Study, folder: Path) -> None:
    """Raise ValueError for an absent device, for networks of no folder, or of the run's own."""
    if study.device == "cuda":
        from snug.training.device import find_device  # loads torch

        find_device(study.device)
    trained = study.trained
    if trained and not trained.is_dir():
        raise StudyError(f"trained: {trained}: no such folder; without DIR the package's are taken")
    # where networks of another training are removed
    if trained and trained.resolve() == folder.resolve():
        raise StudyError(f"trained: {trained}: the folder of this run itself: give another by --out")


def choose_folder(folder: Path | None) -> Path:
    """Return the folder of the run, not created yet; one that holds a run is continued.

    Raises:
        StudyError: where it cannot be made, or holds other things.
    """
    if folder is None:
        folder = Path("reports", "runs", datetime.now().strftime("%Y-%m-%d_%H-%M-%S"))
    elif folder.exists() and not folder.is_dir():
        raise StudyError(f"--out {folder}: is a file; name a folder")
    elif RunFolder(folder).config_path.is_file():
        try:
            RunFolder(folder).read_config()
        except ResultsError as error:
            raise StudyError(f"--out {error}; name another folder") from None
    elif folder.is_dir() and any(folder.iterdir()):
        raise StudyError(f"--out {folder}: is not empty and holds no run; name a new folder")
    try:
        demand_writable_folder(folder)
    except ValueError as error:
        raise StudyError(f"--out {error}") from None
    return folder
