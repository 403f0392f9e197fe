"""Declarations that cannot be meant are refused, each by one line that names them."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks import methods as methods
from benchmarks import metrics, scenes
from benchmarks.declarations import DeclarationError
from benchmarks.metric import Measurements, Metric
from benchmarks.presets import find_preset
from tests.benchmarks.runner.tasks_by_hand import small_scene


def test_a_name_stands_once(monkeypatch):
    monkeypatch.setattr(scenes, "SCENES", (*scenes.SCENES, scenes.SCENES[0]))
    with pytest.raises(DeclarationError, match="scene 'hanging_sheet' is declared twice"):
        scenes.all_scenes((), ())
    monkeypatch.setattr(methods, "METHODS", (*methods.METHODS, methods.METHODS[0]))
    with pytest.raises(DeclarationError, match="method 'simulation' is declared twice"):
        methods.find_method("skinning")
    scene = small_scene("hanging_sheet")
    with pytest.raises(DeclarationError, match="energy 'strain' is declared twice"):
        dataclasses.replace(scene, energies=(*scene.energies, scene.energies[0]))


def test_a_metric_is_declared_once(monkeypatch):
    mine = Metric(name="energy/total", unit="J", title="Mine", definition="mine")
    monkeypatch.setattr(metrics, "MEASUREMENTS", (*metrics.MEASUREMENTS, Measurements("mine", (mine,))))
    metrics.declared.cache_clear()
    with pytest.raises(DeclarationError, match="'energy/total' is declared"):
        metrics.declared()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"unit": ""}, "metric 'mine/x' has no unit: say '1' where it has no dimension"),
        ({"of": "clock"}, "metric 'mine/x': of='clock'"),
    ],
)
def test_a_metric_says_its_unit_and_says_it_in_words(wrong, message):
    with pytest.raises(ValueError, match=message):
        Metric(**{"name": "mine/x", "unit": "J", "title": "Mine", "definition": "mine"} | wrong)


def test_a_role_and_a_size_that_nobody_knows_are_named():
    with pytest.raises(DeclarationError, match="unknown role 'solvr'; use one of reference, "):
        dataclasses.replace(methods.METHODS[0], role="solvr")
    scene = dataclasses.replace(scenes.SCENES[0], sizes=("sheet_cell",))
    with pytest.raises(DeclarationError, match="'sheet_cell', which no preset has"):
        scene.at(find_preset("smoke"))
