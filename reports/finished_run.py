"""A finished run: its rows, declarations and stored roll-outs, as its folder holds them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from textwrap import shorten
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results import run_folder
from benchmarks.results.protocol import FAMILY, SECOND_STARTS, one_protocol
from benchmarks.results.row import COLUMNS, OPTIONAL_NUMBERS, ROLES, USABLE, ResultsError, Row
from benchmarks.results.run_folder import RunFolder
from reference_sim.files.array_file import read_arrays
from reference_sim.trajectory import Trajectory, TrajectoryError

STEP = "step/vertices"  # curve of a roll-out: one-step error of each vertex (T,V) [mm]


@dataclass(frozen=True)
class RollOuts:
    """Stored roll-outs of a run's folder, none without one.

    One that cannot be read adds a sentence to `problems`.
    """

    folder: RunFolder | None = None
    problems: list[str] = field(default_factory=list)

    def cloth(self, scene: str, method: str, seed: int) -> Trajectory | None:
        """Return a method's roll-out of the scene, None where there is none to be read."""
        return self._read(self.folder.trajectory_path(scene, method, seed)) if self.folder else None

    def body(self, scene: str) -> Trajectory | None:
        """Return the moving body of the scene, None where there is none to be read."""
        return self._read(self.folder.trajectory_path(scene, "body")) if self.folder else None

    def _read(self, path: Path) -> Trajectory | None:
        """Return the trajectory in a file with the curves that lie beside it, None without one."""
        try:
            if not path.is_file():
                return None
            trajectory = Trajectory.load(path)
            if (curves := path.with_suffix(".npz")).is_file():
                trajectory = replace(
                    trajectory, frame_fields=trajectory.frame_fields | read_arrays(curves)
                )
            if trajectory.frames:
                return trajectory
            problem = f"{path}: holds no whole frame"
        except (TrajectoryError, ValueError, OSError) as error:
            problem = str(error)
        if problem not in self.problems:  # the page reads again what was drawn
            self.problems.append(problem)
        return None


CATEGORIES = ("scene", "method", "metric")  # columns kept as such, for speed
SUITES = ("garments", "speed", "validation", "extremes", "shapes")  # that have tables of their own


@dataclass(frozen=True)
class ReportedMethod:
    """A method as its rows declare it, see benchmarks.results.row.Row; label: its name for people."""

    name: str
    label: str
    role: str = ""
    family: str = ""
    level: float | None = None
    base: str = ""


@dataclass(frozen=True, eq=False)
class Run:
    """Rows of a run, their declarations, and what else its folder holds.

    frame: one line per row, the columns of results.csv and `usable` (its value may enter a mean), `table`
    (of its metric) and `case` (the check or stress test that it is, else empty). changed: files that are
    not as the run wrote them. protocol: of its rows; empty where all are a user's own. frame_energies:
    lines of frame_energies.csv, empty without the file. roll_outs: reads them when they are asked for.
    problems: a sentence for each file that could not be read so far.
    """

    config: Mapping[str, Any]
    frame: pd.DataFrame
    metrics: Mapping[str, Metric]
    methods: Mapping[str, ReportedMethod]
    changed: Sequence[str] = ()
    protocol: str = ""
    frame_energies: pd.DataFrame = field(default_factory=pd.DataFrame)
    roll_outs: RollOuts = field(default_factory=RollOuts)
    problems: list[str] = field(default_factory=list)
    _cells: dict[tuple[str, ...], pd.DataFrame] = field(default_factory=dict, init=False)

    def suite(self, *names: str) -> pd.DataFrame:
        """Return the rows of these suites."""
        return self.frame[self.frame["suite"].isin(names)]

    def cells(self, *suites: str) -> pd.DataFrame:
        """Return the rows of these suites that are no case, each cell from the first suite that has it.

        Without names they are of all suites, those of a study's own after SUITES.
        """
        suites = suites or tuple(dict.fromkeys((*SUITES, *self.frame["suite"])))
        if suites not in self._cells:
            rows = self.suite(*suites)
            rows = rows[rows["case"] == ""]
            rows = rows.sort_values("suite", key=lambda s: s.map(suites.index), kind="stable")
            self._cells[suites] = rows.drop_duplicates(["scene", "method", "seed", "metric"])
        return self._cells[suites]

    @cached_property
    def garment_rows(self) -> pd.DataFrame:
        """Rows of suite garments, which are averaged over the scenes of a garment.

        Only motions that no network has trained on count, unless there are no others.
        """
        rows = self.suite("garments")
        rows = rows[rows["garment"] != ""]
        unseen = rows[~rows["scene"].isin(self.with_motion("training"))]
        return rows if unseen.empty else unseen

    def select_garment(self, garment: str) -> pd.DataFrame:
        """Return the garment_rows of one garment."""
        return self.garment_rows[self.garment_rows["garment"] == garment]

    def with_motion(self, role: str) -> list[str]:
        """Return the scenes, as declared, whose motion has that role: training, validation or test."""
        scenes = self.config.get("scenes") or {}
        return [name for name, scene in scenes.items() if scene.get("role") == role]

    def garments(self, frame: pd.DataFrame) -> dict[str, list[str]]:
        """Return garment -> its scenes among these rows, in the order in which run.json declares them."""
        declared = {name: k for k, name in enumerate(self.config.get("scenes") or ())}
        pairs = frame[frame["garment"] != ""][["garment", "scene"]].drop_duplicates()
        scenes: dict[str, list[str]] = {}
        for garment, scene in sorted(pairs.itertuples(index=False), key=lambda p: declared.get(p[1], 0)):
            scenes.setdefault(garment, []).append(scene)
        return scenes

    @property
    def first_garment(self) -> str:
        """Garment that page one and the claims are about; empty for a run without garments."""
        return next(iter(self.garments(self.garment_rows)), "")

    def order(self, methods: Iterable[str]) -> list[str]:
        """Return the methods without repeats: by role, then as declared, members of a family by level."""
        families = [method.family for method in self.methods.values()]

        def rank(name: str) -> tuple[int, int, float, str]:
            method = self.methods[name]
            return ROLES.index(method.role), families.index(method.family), method.level or 0.0, name

        return sorted(set(methods), key=rank)

    def with_role(self, *roles: str) -> list[str]:
        """Return the methods that have one of the roles, as declared."""
        return [name for name, method in self.methods.items() if method.role in roles]

    @property
    def reference(self) -> str:
        """Name of the simulation that others are measured against; empty where it did not run."""
        return next(iter(self.with_role("reference")), "")

    @property
    def reference_family(self) -> list[str]:
        """Members of the reference's family, which take its place in turn."""
        return [name for name in self.methods if name in FAMILY]

    @property
    def twins(self) -> set[str]:
        """Simulations as valid as the reference: its noise, and no rows of tables."""
        return {*SECOND_STARTS, "simulation-refrozen", "simulation-1e-8"} & self.methods.keys()

    def label(self, method: str) -> str:
        """Return the method's name for people."""
        return self.methods[method].label if method in self.methods else method

    @property
    def machines(self) -> list[str]:
        """Return the hardware that measured times of frames [ms]; trainings [s] may be of another."""
        times = self.frame[(self.frame["unit"] == "ms") & self.frame["value"].notna()]
        return sorted(set(times["hardware"]) - {""})

    @property
    def warnings(self) -> list[str]:
        """Return what a reader has to know first: times of several machines, files that were edited."""
        machines = self.machines
        remarks = [f"Times are of several machines: {', '.join(machines)}"] if len(machines) > 1 else []
        if self.changed:
            remarks.append(f"Not as the run wrote them: {shorten(', '.join(self.changed), 100)}")
        return remarks

    def find_ablations(self, frame: pd.DataFrame) -> set[str]:
        """Return the ablations whose base has a usable number: they have their own table."""
        usable = set(frame[frame["usable"]]["method"])
        return {name for name in self.with_role("ablation") if self.methods[name].base in usable}


def pick_seeds(rows: pd.DataFrame) -> pd.Series:
    """Return (scene, method) -> first seed whose roll-out came to its end; the first where none did."""
    ordered = rows.sort_values(["usable", "seed"], ascending=[False, True])
    return ordered.groupby(["scene", "method"])["seed"].first()


def shown_frames(run: Run, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the frame energies in the scenes of these rows, of each method those of `pick_seeds`."""
    frames = run.frame_energies
    return frames if frames.empty else frames.merge(pick_seeds(rows).reset_index())


def make_run(config: Mapping[str, Any], rows: Sequence[Row], changed: Sequence[str] = ()) -> Run:
    """Make the run of these rows; a metric that run.json does not declare has no table."""
    frame = pd.DataFrame.from_records(
        [[getattr(row, name) for name in COLUMNS] for row in rows], columns=list(COLUMNS)
    )
    frame[list(OPTIONAL_NUMBERS)] = frame[list(OPTIONAL_NUMBERS)].astype(float)
    finite = frame["value"].abs() < float("inf")
    frame["usable"] = frame["status"].isin(USABLE) & finite
    declared = config.get("metrics") or {}
    units = dict(zip(frame["metric"], frame["unit"]))
    names = [name for name in dict.fromkeys([*declared, *units]) if name in units]
    metrics = {name: _metric(name, units[name], declared.get(name) or {}) for name in names}
    frame["table"] = frame["metric"].map({name: metric.table for name, metric in metrics.items()})
    frame["case"] = _cases(frame, config.get("cases") or {})
    kinds = {name: pd.CategoricalDtype(sorted(set(frame[name]))) for name in CATEGORIES}
    frame = frame.astype(kinds)
    methods = _methods(frame, config.get("methods") or {})
    return Run(config, frame, metrics, methods, changed)


def _metric(name: str, unit: str, declared: Mapping[str, Any]) -> Metric:
    fields: dict[str, Any] = {"title": name, "definition": ""}
    fields |= {key: value for key, value in declared.items() if key in Metric.__dataclass_fields__}
    return Metric(**fields | {"name": name, "unit": unit or "1"})


def _methods(frame: pd.DataFrame, declared: Mapping[str, Any]) -> dict[str, ReportedMethod]:
    """Return the methods in the order of run.json, those that it does not know behind."""
    columns = ["method", "role", "family", "level", "base"]
    rows = frame[frame["method"] != ""][columns].drop_duplicates("method")
    if unknown := sorted(set(rows["role"]) - {*ROLES}):
        raise ValueError(f"role '{unknown[0]}' is none of {', '.join(filter(None, ROLES))}")
    by_name = {
        name: ReportedMethod(
            name, str((declared.get(name) or {}).get("label") or name), role, family or name,
            None if pd.isna(level) else level, base,
        )
        for name, role, family, level, base in rows.itertuples(index=False)
    }  # fmt: skip
    return {name: by_name[name] for name in dict.fromkeys([*declared, *by_name]) if name in by_name}


def _cases(frame: pd.DataFrame, declared: Mapping[str, Any]) -> list[str]:
    """Return the case of each row: declared by scene and metric, or else by the scene as its name."""
    places = {
        (case.get("scene") or name, case.get("metric") or ""): name for name, case in declared.items()
    }
    pairs = zip(frame["scene"], frame["metric"])
    return [places.get(pair) or places.get((pair[0], "")) or "" for pair in pairs]


def read_run(folder: RunFolder) -> Run:
    """Read rows and declarations of a run.

    Raises:
        ResultsError: when run.json or results.csv is absent, broken or of an earlier version, or rows are
            of two protocols, which no table may mix.

    >>> run = read_run(RunFolder("reports/runs/first"))  # doctest: +SKIP
    """
    if not folder.path.is_dir():
        raise ResultsError(f"{folder.path}: no such folder")
    config, rows = folder.read_config(), folder.read_rows()
    if not rows:
        raise ResultsError(f"{folder.rows_path}: holds no rows; nothing to report")
    try:
        changes = folder.find_changes(config.get("digests") or {})
        damaged = [name for name, state in changes.items() if state == "damaged"]
        run = make_run(config, rows, damaged)
        run.garments(run.garment_rows)  # reads the scenes
    except (ValueError, TypeError, AttributeError) as error:
        raise ResultsError(
            f"{folder.config_path}: does not fit results.csv ({error}); take both from one run"
        ) from None
    return replace(
        run,
        protocol=one_protocol(run.frame["protocol"], folder.rows_path),
        frame_energies=run_folder.read_frame_energies(run_folder.find_file(folder.frame_energies_path)),
        roll_outs=RollOuts(folder, run.problems),
    )
