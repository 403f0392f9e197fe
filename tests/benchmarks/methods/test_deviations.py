"""Deviations of the recipe as methods: named, never chosen by test motions, equal in steps."""

from __future__ import annotations

import pytest

from benchmarks.methods.catalogue.all_methods import find_method
from benchmarks.methods.catalogue.trainings import TRAININGS
from benchmarks.plan.choose_cells import Selection, choose_cells
from benchmarks.plan.motion_split import split_motions
from benchmarks.plan.options import EXAMPLES
from benchmarks.plan.plan import Motions, PlanError
from benchmarks.presets import find_preset
from snug.motion.library import TEST, VALIDATION
from snug.recipes.deviations import DEVIATIONS

NAMES = {
    *(f"snug-without-{deviation.name}" for deviation in DEVIATIONS),
    *(f"snug-paper-with-{deviation.name}" for deviation in DEVIATIONS),
}


def chosen(*methods, **changes):
    criteria = {"suites": ("garments", "extremes"), "preset": find_preset("paper")} | changes
    motions = Motions(("walk",), ("kick",), {}, ("twist_stop",))
    cells = choose_cells(Selection(motions=motions, methods=methods, **criteria))[0]
    return {cell.method for cell in cells}


def test_a_deviation_is_a_method_for_whoever_names_it():
    for name in NAMES:
        assert name == f"snug-{TRAININGS[name].recipe.name}"
        entry = find_method(name)
        assert entry.trained == name and entry.role == "ablation" and entry.seeded
        assert entry.reporting.base == ("snug-paper" if "paper" in name else "snug")
    assert not NAMES & chosen() and not NAMES & chosen(full=True)
    assert chosen("snug-without-*") == {name for name in NAMES if "without" in name}
    assert chosen("snug-paper-with-*") == NAMES - chosen("snug-without-*")
    with pytest.raises(PlanError):
        chosen(
            "snug-without-*", suites=("extremes", "speed", "validation")
        )  # what they are asked is garments


def test_a_recipe_is_never_chosen_by_the_test_motions():
    arguments = [word for line in EXAMPLES.splitlines() if "snug-without" in line for word in line.split()]
    assert arguments and "--split validation" in EXAMPLES and "--test-motions" not in arguments
    motions = split_motions([], [], find_preset("quick"), split="validation")
    assert motions.measured == VALIDATION[:8] and not set(TEST) & {*motions.measured, *motions.train}
    with pytest.raises(PlanError, match="'dance_turn' is a test motion"):
        split_motions([], [], find_preset("quick"), validation_names=["dance_turn"], split="validation")


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
