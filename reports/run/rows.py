"""What a run left behind: its rows as one table, and what run.json declares of metrics, methods and cases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from benchmarks.results.row import COLUMNS, OPTIONAL_NUMBERS, ROLES, USABLE, Row, as_right

STEP = "step/vertices"  # of the curves of a roll-out: the one-step error of each vertex (T,V) [mm]
SUITES = ("garments", "speed", "validation", "extremes", "shapes", "performance")


@dataclass(frozen=True)
class Metric:
    """A metric as it is declared, see benchmarks.metric.Metric: head of its column, a sentence on it, and the
    table that has the column; which side is better, and what comparisons may make of it.
    """

    name: str
    unit: str = ""
    title: str = ""
    definition: str = ""
    table: str = ""
    lower_is_better: bool | None = None
    arbitrary_zero: bool = False
    of: str = "answer"

    @property
    def heading(self) -> str:
        """Its title, and its unit where it has one."""
        return f"{self.title} [{self.unit}]" if self.unit not in ("", "1") else self.title


@dataclass(frozen=True)
class Method:
    """A method as its rows declare it, see benchmarks.results.row.Row; label is its name for people."""

    name: str
    label: str
    role: str = ""
    family: str = ""
    level: float | None = None
    base: str = ""


@dataclass(frozen=True, eq=False)
class Run:
    """The rows and their declarations.

    frame: one line per row, the columns of results.csv and `usable` (its value may enter a mean), `table` (of
    its metric) and `case` (the check or stress test that it is, else empty). changed: files that are not as
    the run wrote them. frames: the lines of benchmarks.results.frame_energies, without any where there is no such
    file.
    """

    config: Mapping[str, Any]
    frame: pd.DataFrame
    metrics: Mapping[str, Metric]
    methods: Mapping[str, Method]
    changed: Sequence[str] = ()
    frames: pd.DataFrame = field(default_factory=pd.DataFrame)

    def suite(self, *names: str) -> pd.DataFrame:
        return self.frame[self.frame["suite"].isin(names)]

    def cells(self, *suites: str) -> pd.DataFrame:
        """The rows of these suites that are no case, each cell once: from the first suite that reports it."""
        kept = self.suite(*suites)
        kept = kept[kept["case"] == ""].sort_values("suite", key=lambda s: s.map(suites.index), kind="stable")
        return kept.drop_duplicates(["scene", "method", "seed", "metric"])

    @property
    def worn(self) -> pd.DataFrame:
        """The rows of suite garments, which are averaged over the scenes of a garment: of motions that nobody
        has trained on, unless there are no others.
        """
        rows = self.suite("garments")
        rows = rows[rows["garment"] != ""]
        unseen = rows[~rows["scene"].isin(self.trained_on)]
        return rows if unseen.empty else unseen

    @property
    def trained_on(self) -> list[str]:
        """Scenes of training motions, as a user's own can be."""
        scenes = self.config.get("scenes") or {}
        return [name for name, said in scenes.items() if said.get("role") == "training"]

    def garments(self, frame: pd.DataFrame) -> dict[str, list[str]]:
        """Garment -> its scenes among these rows, in the order in which run.json declares them."""
        declared = {name: place for place, name in enumerate(self.config.get("scenes") or ())}
        pairs = frame[frame["garment"] != ""][["garment", "scene"]].drop_duplicates()
        found: dict[str, list[str]] = {}
        for garment, scene in sorted(pairs.itertuples(index=False), key=lambda p: declared.get(p[1], 0)):
            found.setdefault(garment, []).append(scene)
        return found

    def ordered(self, methods: Iterable[str]) -> list[str]:
        """Without repeats: by role, then as declared, members of a family by their level."""
        places = list(self.methods)
        first: dict[str, int] = {}
        for method in self.methods.values():
            first.setdefault(method.family, places.index(method.name))

        def rank(name: str) -> tuple[int, int, float, str]:
            method = self.methods[name]
            return ROLES.index(method.role), first[method.family], method.level or 0.0, name

        return sorted(set(methods), key=rank)

    def with_role(self, *roles: str) -> list[str]:
        return [name for name, method in self.methods.items() if method.role in roles]

    @property
    def reference(self) -> str:
        """The name of the simulation that others are measured against; empty where it did not run."""
        return next(iter(self.with_role("reference")), "")

    @property
    def twins(self) -> list[str]:
        """Simulations as right as the reference."""
        return [name for name, method in self.methods.items() if as_right(method.family, method.level)]

    def label(self, method: str) -> str:
        return self.methods[method].label if method in self.methods else method

    def standing_apart(self, frame: pd.DataFrame) -> set[str]:
        """The ablations among these rows whose base has a usable number too: they have their own table."""
        usable = set(frame[frame["usable"]]["method"])
        return {name for name in self.with_role("ablation") if self.methods[name].base in usable}


def shown_seeds(rows: pd.DataFrame) -> pd.Series:
    """(scene, method) -> the first seed whose roll-out came to its end; the first where none did."""
    good = rows[rows["usable"]].groupby(["scene", "method"])["seed"].min()
    return good.combine_first(rows.groupby(["scene", "method"])["seed"].min()).astype(int)


def run_data(config: Mapping[str, Any], rows: Sequence[Row], changed: Sequence[str] = ()) -> Run:
    """The run of these rows. What run.json does not declare is named after itself and has no table."""
    frame = pd.DataFrame.from_records(
        [[getattr(row, name) for name in COLUMNS] for row in rows], columns=list(COLUMNS)
    )
    frame[list(OPTIONAL_NUMBERS)] = frame[list(OPTIONAL_NUMBERS)].astype(float)
    finite = frame["value"].abs() < float("inf")
    frame["usable"] = frame["status"].isin(USABLE) & finite
    declared = config.get("metrics") or {}
    units = dict(zip(frame["metric"], frame["unit"]))
    names = [*(name for name in declared if name in units), *(name for name in units if name not in declared)]
    metrics = {name: _metric(name, units[name], declared.get(name) or {}) for name in names}
    frame["table"] = frame["metric"].map({name: metric.table for name, metric in metrics.items()})
    frame["case"] = _cases(frame, config.get("cases") or {})
    methods = _methods(frame, config.get("methods") or {})
    return Run(config, frame, metrics, methods, changed)


def _metric(name: str, unit: str, said: Mapping[str, Any]) -> Metric:
    lower = said.get("lower_is_better")
    return Metric(
        name, unit, str(said.get("title") or name), str(said.get("definition") or ""),
        str(said.get("table") or ""), None if lower is None else bool(lower),
        bool(said.get("arbitrary_zero")), str(said.get("of") or "answer"),
    )  # fmt: skip


def _methods(frame: pd.DataFrame, declared: Mapping[str, Any]) -> dict[str, Method]:
    """In the order of run.json, those that it does not know behind."""
    columns = ["method", "role", "family", "level", "base"]
    rows = frame[frame["method"] != ""][columns].drop_duplicates("method")
    found = {
        name: Method(
            name, str((declared.get(name) or {}).get("label") or name), role, family or name,
            None if pd.isna(level) else level, base,
        )
        for name, role, family, level, base in rows.itertuples(index=False)
    }  # fmt: skip
    return {name: found[name] for name in dict.fromkeys([*declared, *found]) if name in found}


def _cases(frame: pd.DataFrame, declared: Mapping[str, Any]) -> list[str]:
    """The case of each row. A case may say the scene and metric of its row; else the scene is its name."""
    places = {(case.get("scene") or name, case.get("metric") or ""): name for name, case in declared.items()}
    pairs = zip(frame["scene"], frame["metric"])
    return [places.get(pair) or places.get((pair[0], "")) or "" for pair in pairs]
