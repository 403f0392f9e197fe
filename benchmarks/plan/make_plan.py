"""From a request to a plan: everything is checked, and every file of a user read, before anything is done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.assets.inputs import LIBRARY, read_inputs
from benchmarks.method import installed
from benchmarks.plan import user_files
from benchmarks.plan.choose_cells import Selection, choose_cells, choose_suites, names_no_motion
from benchmarks.plan.motion_split import split_motions
from benchmarks.plan.plan import DEFAULT_ONLY, STATES, Motions, Plan, PlanError
from benchmarks.plan.request import Request
from benchmarks.provenance import usable_cores
from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder
from benchmarks.scenes import GARMENT_SCENES, GarmentScenes, all_scenes
from benchmarks.scenes.textile_tests import textile_tests
from reference_sim.files.atomic_files import demand_writable_folder
from snug.garments.options import GarmentFile, demand_usable_name

if TYPE_CHECKING:
    from benchmarks.assets.inputs import UserBody
    from benchmarks.fabrics.fabric import Fabric
    from benchmarks.scene import Scene
    from benchmarks.validation.case import Case

WORKERS = 2  # the same everywhere, so that seconds of two runs can be compared; fewer cores, fewer workers


def make_plan(request: Request) -> Plan:
    """Return the plan of a request: cells, cases, motions and a user's inputs as read.

    Raises:
        ValueError: one line for the first thing that cannot be met, with what there is instead. Nothing has
            been created then.

    >>> plan = make_plan(Request(scenes=("flag",), methods=("simulation",)))
    >>> [scene.name for scene in plan.scenes]
    ['flag']
    """
    suites = choose_suites(request.suites)
    check_seeds(request.seeds)
    check_device(request.device)
    check_scheduler_fits(request)
    folder = choose_folder(request.folder)
    only = choose_states(request.only, fresh=request.fresh)
    workers = choose_workers(request.workers)
    scenes, user_scenes = user_files.resolve(user_files.SCENES, request.scenes)
    methods, user_methods = user_files.resolve(user_files.METHODS, request.methods)
    user_scenes = [*request.further_scenes, *user_scenes]
    if request.garment:
        check_garment_name(request.garment)
    inputs = read_inputs(request.body, request.garment, request.motions, request.motion_options)
    motions, named = Motions(), (request.motions, request.test_motions, request.validation_motions)
    if any(named) or not names_no_motion(scenes, user_scenes):
        motions = split_motions(
            inputs.motions, request.test_motions, request.preset, library=LIBRARY in request.motions,
            validation_names=request.validation_motions, split=request.split,
        )  # fmt: skip
    if request.garment:
        motions = replace(motions, worn=(scenes_of_file(request.garment), *motions.worn[1:]))
    if request.self_contact:
        if not installed("ipctk"):
            raise PlanError("--self-contact needs the package ipctk: pip install ipctk")
        motions = replace(motions, worn=tuple(replace(w, self_contact=True) for w in motions.worn))
    cells, cases = choose_cells(
        Selection(
            suites=suites, full=bool(request.suites), preset=request.preset, motions=motions,
            scenes=tuple(scenes), methods=tuple(methods), seeds=request.seeds,
            user_scenes=tuple(user_scenes), user_methods=tuple(user_methods), roll_outs=request.roll_outs,
            one_scene=request.one_scene, **tests_of_fabrics(request, suites),
        )
    )  # fmt: skip
    check_body_shapes(inputs.body, [cell.scene for cell in cells])
    asked = {suite for cell in cells for suite in cell.suites} | {case.suite for case in cases}
    return Plan(
        preset=request.preset,
        suites=tuple(suite for suite in suites if suite in asked),
        cells=cells,
        cases=cases,
        metrics=choose_metrics(request.metrics),
        motions=motions,
        inputs=inputs,
        seeds=request.seeds,
        device=request.device,
        folder=folder,
        only=only,
        fresh=request.fresh,
        workers=workers,
        scheduler=request.scheduler,
        trained=check_trained(request, folder),
        command=request.command,
    )


def tests_of_fabrics(request: Request, suites: Sequence[str]) -> dict[str, Any]:
    """Return the fields of a Selection that a user's files of fabrics fill. Raises ValueError."""
    options = {"--fabrics": request.fabrics, "--gauge": request.gauge}
    named = [f"{option} {path}" for option, path in options.items() if path is not None]
    if named and "fabric" not in suites:
        raise PlanError(f"{named[0]}: only suite fabric tests fabrics: add --suite fabric")
    sample: list[Fabric] = []
    cases: list[Case] = []
    if request.fabrics is not None:
        from benchmarks.fabrics.measured import read_fabrics, spread_sample
        from benchmarks.validation.fabric.cases import percentiles

        fabrics = read_fabrics(request.fabrics)
        sample += [replace(fabric, name=f"measured/{fabric.name}") for fabric in spread_sample(fabrics)]
        cases += percentiles(fabrics)
    if request.gauge is not None:
        from benchmarks.fabrics.gauge import read_gauge

        sample += [replace(fabric, name=f"gauge/{fabric.name}") for fabric in read_gauge(request.gauge)]
    return {"fabric_scenes": textile_tests(sample), "fabric_cases": tuple(cases)}


def choose_metrics(files: Sequence[str]) -> tuple[str, ...]:
    """Return the modules of metrics that are not the project's. Raises ValueError."""
    if not files:
        return ()
    from benchmarks.metrics import declared  # loads numpy

    names, metrics = user_files.resolve(user_files.METRICS, files)
    for name in names:
        if name not in {metric.name for metric in metrics}:
            raise PlanError(f"--metrics {name}: is no file; those of the project are measured without it")
    homes = tuple(dict.fromkeys(metric.declared_in for metric in metrics))
    declared(homes)  # each name stands once
    return homes


def check_garment_name(file: GarmentFile) -> None:
    """Raise ValueError unless scenes can be named after the file of a garment, and none are."""
    demand_usable_name(file.path)
    taken = {scene.split("/")[0] for scene in all_scenes((), ())} | {
        scenes.garment for scenes in GARMENT_SCENES
    }
    if file.name in taken:
        raise PlanError(
            f"--garment {file.path}: the project has scenes of that name: give the file another name"
        )


def check_body_shapes(user_body: UserBody | None, scenes: Sequence[Scene]) -> None:
    """Raise PlanError for a user's body with fewer shapes than a scene of the project sets."""
    if user_body is None:
        return
    count = user_body.body.shape_count
    for scene in scenes:
        needed = 0 if scene.declared_in else len(scene.options.get("betas", ()))
        if needed > count:
            raise PlanError(
                f"--body {user_body.path}: has {count} body shapes (array 'shapedirs'), scene {scene.name} "
                f"needs {needed}: give a body with as many, or name other scenes by --scenes"
            )


def scenes_of_file(file: GarmentFile) -> GarmentScenes:
    """Return the scenes of a user's garment, which take the place of the T-shirt's."""
    return GarmentScenes(file.name, f"a garment of {file.path.name}")


def check_seeds(seeds: Sequence[int]) -> None:
    """Raise PlanError unless there are seeds, none below 0 or beyond 63 bits."""
    if not seeds or min(seeds) < 0 or max(seeds) >= 1 << 63:
        given = ",".join(map(str, seeds))
        wanted = "at least one whole number, none below 0 or beyond 63 bits"
        raise PlanError(f"--seeds '{given[:40]}': give {wanted}")


def choose_workers(count: int | None) -> int:
    """Return how many processes run side by side. Raises PlanError for less than one."""
    workers = min(WORKERS, usable_cores()) if count is None else count
    if workers < 1:
        raise PlanError(f"--workers {workers}: give a whole number, 1 or more")
    return workers


def choose_states(states: Sequence[str], *, fresh: bool) -> frozenset[str]:
    """Return the states of records whose work is done again. Raises PlanError."""
    for state in states:
        if state not in STATES[1:]:
            raise PlanError(f"--only: unknown state '{state}'; choose from {', '.join(STATES[1:])}")
    if states and fresh:
        raise PlanError("--fresh does everything again: leave out --only")
    return frozenset(states or DEFAULT_ONLY)


def check_device(device: str) -> None:
    """Raise PlanError for an unknown device, and DeviceError for one that this machine does not have."""
    if device not in ("cpu", "cuda"):
        raise PlanError(f"--device '{device}': choose cpu or cuda")
    if device == "cuda":
        from snug.training.device import find_device  # loads torch

        find_device(device)


def check_trained(request: Request, folder: Path) -> Path | None:
    """Return the folder of pretrained networks, None without one.

    Raises:
        PlanError: it is no folder, or the run's own, where networks of another training are removed.
    """
    if request.trained is None:
        return None
    if not request.trained.is_dir():
        raise PlanError(f"--trained {request.trained}: no such folder; without DIR the package's are taken")
    if request.trained.resolve() == folder.resolve():
        raise PlanError(f"--trained {request.trained}: the folder of this run itself: give another by --out")
    if request.scheduler:
        raise PlanError("--trained: its files lie on this machine alone; leave out --scheduler")
    return request.trained


def check_scheduler_fits(request: Request) -> None:
    """Raise PlanError for what a cluster cannot do, and ClusterError where no scheduler answers."""
    if not request.scheduler:
        return
    if request.device != "cpu":
        raise PlanError(
            f"--device {request.device}: on a cluster networks train on cpu; leave out --scheduler"
        )
    if request.roll_outs:
        raise PlanError("--rollout: its files lie on this machine alone; leave out --scheduler")
    from benchmarks.process.cluster_address import check_scheduler  # loads dask

    check_scheduler(request.scheduler)


def choose_folder(folder: Path | None) -> Path:
    """Return the folder of the run, not created yet; one that holds a run is continued.

    Raises:
        PlanError: where it cannot be made, or holds other things.
    """
    if folder is None:
        root = Path("reports") / "runs"
        stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        candidates = [root / stamp, *(root / f"{stamp}-{n}" for n in range(2, 100))]
        folder = next(path for path in candidates if not path.exists())
    elif folder.exists() and not folder.is_dir():
        raise PlanError(f"--out {folder}: is a file; name a folder")
    elif RunFolder(folder).config_path.is_file():
        _check_run(folder)
    elif folder.is_dir() and any(folder.iterdir()):
        raise PlanError(f"--out {folder}: is not empty and holds no run; name a new folder")
    try:
        demand_writable_folder(folder)
    except ValueError as error:
        raise PlanError(f"--out {error}") from None
    return folder


def _check_run(folder: Path) -> None:
    try:
        config = RunFolder(folder).read_config()
    except ResultsError as error:
        raise PlanError(f"--out {error}; name another folder") from None
    if "merged" in config:
        raise PlanError(f"--out {folder}: is merged of several runs, which go on in their own folders")
