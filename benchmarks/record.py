"""What a run keeps while it goes on: its folder, its configuration, its rows and the time of each stage."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import Any

from . import provenance
from .plan import Plan
from .records import Records
from .results import Row, RunFolder, with_provenance


class Record:
    """run.json and results.csv of one run, each written whole at every change. Making it makes the folder."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.folder = RunFolder(plan.folder)
        self.hardware = provenance.hardware(plan.device)
        self.commit = provenance.commit()
        self.records = Records(self.folder, only=plan.only, commit=self.commit)
        self.reused: list[str] = []  # labels of what an earlier run in this folder had finished
        self.rows: list[Row] = []
        self.stages: list[dict[str, Any]] = []
        self.config: dict[str, Any] = {
            "command": plan.command,
            "preset": plan.preset.name,
            "suites": list(plan.suites),
            "scenes": [scene.name for scene in plan.scenes],
            "methods": list(dict.fromkeys(cell.method for cell in plan.cells)),
            "motions": {
                f"{what} {garment}": list(names(garment))
                for garment in plan.garments
                for what, names in (("train", plan.train_of), ("test", plan.test_of))
            },
            "body": [plan.body.path.name, plan.body.digest] if plan.body else "of the package",
            "seeds": list(plan.seeds),
            "clock": {"name": "time.perf_counter", "threads": 1, "cells_at_a_time": 1},
            "workers": plan.workers,
            "commit": self.commit,
            "started": now(),
            "finished": None,
            "hardware": self.hardware,
            "versions": provenance.versions(),
            "preset_values": dataclasses.asdict(plan.preset),
            "stages": self.stages,
            "earlier": self._earlier(),
        }
        plan.folder.mkdir(parents=True, exist_ok=True)
        self.folder.remove_parts()
        if plan.fresh:
            self.records.forget_all()
        self.folder.write_config(self.config)

    def _earlier(self) -> list[dict[str, Any]]:
        """Earlier runs in this folder: their stages are the times of what this one reuses."""
        if not self.folder.config_path.is_file():
            return []
        before = self.folder.read_config()
        names = ("command", "commit", "started", "finished", "stages")
        return [*before.get("earlier", []), {name: before.get(name) for name in names}]

    def note(self, name: str, value: Any) -> None:
        """Set an entry of run.json and write it."""
        self.config[name] = value
        self.folder.write_config(self.config)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Announce a stage and keep its wall time, also when it is interrupted."""
        print(f"== {name}", file=sys.stderr, flush=True)
        clock = time.perf_counter()
        try:
            yield
        finally:
            self.stages.append({"name": name, "seconds": round(time.perf_counter() - clock, 3)})
            self.folder.write_config(self.config)

    def write_rows(self) -> None:
        """results.csv with the rows so far. Of all that is measured training alone uses an accelerator."""
        everything = provenance.hardware_line(self.hardware)
        processor = provenance.hardware_line(self.hardware | {"accelerator": None})
        of_training = ("cost/setup", "cost/train")
        self.rows = [
            dataclasses.replace(row, hardware=everything if row.metric in of_training else processor)
            for row in with_provenance(self.rows, preset=self.plan.preset.name, commit=self.commit)
        ]
        self.folder.write_rows(self.rows)


def now() -> str:
    """The time as ISO text with its zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")
