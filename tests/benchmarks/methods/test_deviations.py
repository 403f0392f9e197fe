"""Deviations of the recipe as methods: named, never chosen by test motions, equal in steps."""

from __future__ import annotations

import pytest

from benchmarks.methods import find_method
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.plan.motions import split_motions
from benchmarks.plan.study import StudyError, read_study
from benchmarks.presets import find_preset
from snug.motion.library import TEST, VALIDATION
from snug.named_recipes import DEVIATIONS
from tests.benchmarks.plan.planned import planned, study_with

NAMES = {
    *(f"snug-without-{deviation.name}" for deviation in DEVIATIONS),
    *(f"snug-paper-with-{deviation.name}" for deviation in DEVIATIONS),
}


def chosen(*methods, study="paper:garments,extremes"):
    words = ("--methods", ",".join(methods)) if methods else ()
    return {cell.method for cell in planned(study, "--test-motions", "kick", *words).cells}


def test_a_deviation_is_a_method_for_whoever_names_it():
    for name in NAMES:
        assert name == f"snug-{TRAININGS[name].recipe.name}"
        entry = find_method(name)
        assert entry.trained == name and entry.role == "ablation" and entry.seeded
        assert entry.reporting.base == ("snug-paper" if "paper" in name else "snug")
    assert not NAMES & chosen() and not NAMES & chosen(study="full")
    assert chosen("snug-without-*") == {name for name in NAMES if "without" in name}
    assert chosen("snug-paper-with-*") == NAMES - chosen("snug-without-*")


def test_a_recipe_is_never_chosen_by_the_test_motions():
    ablations = read_study("ablations")
    assert ablations.split == "validation" and not ablations.test_motions
    motions = split_motions(ablations)
    assert motions.measured == VALIDATION[:8] and not set(TEST) & {*motions.measured, *motions.train}
    with pytest.raises(StudyError, match="'dance_turn' is a test motion"):
        split_motions(study_with(validation_motions="dance_turn", split="validation"))


@pytest.mark.parametrize("preset", ["smoke", "quick", "paper"])
def test_a_deviation_is_trained_for_as_many_steps_as_the_recipe_that_it_changes(preset):
    sizes = find_preset(preset)
    steps = {
        name: sizes.steps_of(TRAININGS[name].steps_of or name, TRAININGS[name].kind)
        for name in ("snug", "snug-paper", *NAMES)
    }
    for base, others in (("snug", "snug-without-"), ("snug-paper", "snug-paper-with-")):
        of_base = {name for name in NAMES if name.startswith(others)}
        assert len(of_base) == len(DEVIATIONS) and {steps[name] for name in of_base} == {steps[base]}
