"""Plan of a command line."""

from __future__ import annotations

from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import make_parser, request_of_run
from benchmarks.plan.plan import Plan


def planned(*options: str) -> Plan:
    return make_plan(request_of_run(make_parser().parse_args(options), options))
