"""run.json and results.csv of a run: who writes them, and what they say."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.metrics import find_metric, list_metrics
from benchmarks.plan.plan import Plan
from benchmarks.provenance import digest, digest_of_file
from benchmarks.results import run_folder
from benchmarks.results.protocol import DIGEST, NUMBER
from benchmarks.results.row import DECLARED, Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.loop import Runner

if TYPE_CHECKING:
    from benchmarks.assets import Assets

OF_ROWS = ("metrics", "methods", "scenes", "cases", "digests", "tasks")


class RunLog:
    """The configuration and the rows of one run. Making it makes the folder."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        body, garment = plan.inputs.body, plan.inputs.garment
        self.folder = RunFolder(plan.folder)
        self.origin = {
            "commit": provenance.commit(), "preset": plan.study.sizes.name, "protocol": NUMBER,
            # Only training uses an accelerator: its rows name it, see networks.train.
            "hardware": provenance.hardware_line(provenance.hardware()),
        }  # fmt: skip
        self.cache = Cache(self.folder, retry=plan.retry, origin=self.origin)
        self.rows: list[Row] = []
        before = self.folder.read_config() if self.folder.config_path.is_file() else {}
        self.config: dict[str, Any] = {
            "command": plan.command,
            "study": dict(plan.study.written),
            "preset": plan.study.sizes.name,
            "protocol": {"number": NUMBER, "digest": DIGEST},
            "motions": {
                f"{role} {garment}": list(names)
                for garment in plan.garments
                for role, names in plan.motions.by_role(garment).items()
            },
            "cut_motions": plan.cut_motions,
            "split": plan.motions.split,
            "body": [body.path.name, body.digest] if body else "of the package",
            "garment": [garment.path.name, garment.digest] if garment else "tailored",
            "seeds": list(plan.study.seeds),
            "clock": {"name": "time.perf_counter", "threads": 1, "cells_at_a_time": 1},
            "workers": plan.workers,
            "commit": self.origin["commit"],
            "started": now(),
            "finished": None,
            "hardware": provenance.hardware(plan.study.device),
            "versions": provenance.versions(),
            "preset_values": dataclasses.asdict(plan.study.sizes),
            "test_looks": before.get("test_looks") or [],
            # What the rows there mean, until there are others.
            **{name: before[name] for name in OF_ROWS if name in before},
        }
        plan.folder.mkdir(parents=True, exist_ok=True)
        self.folder.remove_parts()
        if plan.fresh:
            self.cache.forget_all()
        self.folder.write_config(self.config)

    def open_assets(self, opened: Assets | None = None) -> Assets:
        """Body, garments and motions. Raises ValueError where one cannot be made."""
        print("body, garments and motions", file=sys.stderr, flush=True)
        assets = opened or self.plan.open_assets()
        self.config["garments"] = {
            name: {"vertices": len(g.rest_positions), "material": dataclasses.asdict(g.material)}
            for name, g in assets.garments.items()
        }
        self.config["motions"]["frames"] = {name: m.frames for name, m in assets.motions.items()}
        self.config["motion_sources"] = {name: m.source for name, m in assets.motions.items()}
        self.folder.write_config(self.config)
        return assets

    def note_outcomes(self, runner: Runner) -> None:
        """Note outcomes of ground truth, trainings and cells, and the end of the run."""
        of_kind: dict[str, dict[str, Any]] = {}
        for task in runner.tasks:
            outcome = runner.outcomes[task.id]
            if task.silent:
                failed = {"failed": outcome.ending} if outcome.failed else {}
                facts = {**outcome.result, **failed, "wall_seconds": round(outcome.seconds, 3)}
                of_kind.setdefault(task.stage, {})[task.label] = facts
        self.config["tasks"], self.config["finished"] = of_kind, now()
        for outcome in runner.outcomes.values():
            self.config["digests"] |= outcome.digests
        self.folder.write_config(self.config)

    def write_rows(self, rows: Sequence[Row]) -> None:
        """results.csv, energies of frames, and what run.json says of them."""
        self.rows = list(rows)
        self.count_look()
        self.folder.write_rows(self.rows)
        run_folder.write_frame_energies(self.folder, self.rows)
        self.config |= describe_plan(self.plan, self.rows)
        paths = (self.folder.rows_path, self.folder.frame_energies_path)
        self.config["digests"] = {path.name: digest_of_file(path) for path in paths if path.is_file()}
        self.folder.write_config(self.config)

    def count_look(self) -> None:
        """Add a look at the test motions where the rows hold new numbers of them."""
        role_of = self.plan.motions.role_of
        tests = {scene.name for scene in self.plan.scenes if role_of(scene.motion) == "test"}
        rows = [row for row in self.rows if row.scene in tests]
        facts = [[row.scene, row.method, row.seed, row.metric, row.value] for row in rows]
        look = {"started": self.config["started"], "commit": self.origin["commit"], "rows": digest(facts)}
        if facts and look["rows"] not in [earlier.get("rows") for earlier in self.config["test_looks"]]:
            self.config["test_looks"] = [*self.config["test_looks"], look]


def now() -> str:
    """Return the time as ISO text with its zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def describe_plan(plan: Plan, rows: Sequence[Row]) -> dict[str, Any]:
    """Return what run.json says of metrics, methods, scenes and cases beside rows."""
    methods = {cell.method: cell.entry for cell in plan.cells}
    order = {name: place for place, name in enumerate(list_metrics(plan.metrics))}
    names = dict.fromkeys(row.metric for row in rows if row.method in methods)
    metrics = {}
    for name in sorted(names, key=lambda name: order.get(name, len(order))):
        with suppress(KeyError):  # of a case, which describes its rows itself
            fields = vars(find_metric(name, plan.metrics))
            metrics[name] = {f: fields[f] for f in fields if f not in ("name", "declared_in")}
    scenes = {
        scene.name: {"description": scene.description, "role": plan.motions.role_of(scene.motion)}
        for scene in plan.scenes
    }
    remarks = {row.method: "declared time" for row in rows if row.reason == DECLARED}
    remarks |= {row.method: "pretrained" for row in rows if row.pretrained}
    of_methods = {
        name: {
            "label": f"{entry.label or name} ({remarks[name]})" if name in remarks else entry.label,
            "description": entry.description,
        }
        for name, entry in methods.items()
    }
    cases = {
        c.name: {"description": c.description, "scene": c.scene or c.name, "metric": c.metric}
        for c in plan.cases
    }
    return {"metrics": metrics, "methods": of_methods, "scenes": scenes, "cases": cases}
