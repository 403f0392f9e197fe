"""A plan in which nothing is asked for but what a test adds."""

from __future__ import annotations

from benchmarks.plan import Plan
from benchmarks.presets import find_preset

SMOKE = find_preset("smoke")


def plan_of(folder, **changes) -> Plan:
    nothing = {"suites": ("validation",), "cells": (), "checks": (), "cases": (), "train": (), "test": ()}
    return Plan(preset=SMOKE, seeds=(0,), device="cpu", folder=folder, command="", **(nothing | changes))
