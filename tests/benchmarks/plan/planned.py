"""Plan of a command line; a study with other fields."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.plan.options import make_parser, study_of
from benchmarks.plan.plan import Plan, make_plan
from benchmarks.plan.study import Study, option, read_study


def planned(*words: str) -> Plan:
    options = make_parser().parse_args(words)
    return make_plan(study_of(options, options.study), folder=Path(options.out) if options.out else None)


def study_with(name: str = "full", **fields: Any) -> Study:
    return read_study(name, [option(field, value) for field, value in fields.items()])
