"""Named recipes: every option in which default and paper differ is one deviation."""

from __future__ import annotations

from dataclasses import fields

from snug.named_recipes import DEVIATIONS, PAPER, exchange_deviations
from snug.recipe import DEFAULT, Recipe


def differing(a: Recipe, b: Recipe) -> set[str]:
    names = (field.name for field in fields(Recipe))
    return {name for name in names if name != "name" and getattr(a, name) != getattr(b, name)}


def test_every_deviation_has_its_line_and_changes_nothing_else():
    listed = [option for deviation in DEVIATIONS for option in deviation.options]
    assert sorted(listed) == sorted(differing(DEFAULT, PAPER))
    recipes = {recipe.name: recipe for recipe in exchange_deviations(DEFAULT, PAPER)}
    assert len(recipes) == 2 * len(DEVIATIONS)
    for deviation in DEVIATIONS:
        undone, added = recipes[f"without-{deviation.name}"], recipes[f"paper-with-{deviation.name}"]
        assert differing(undone, DEFAULT) == differing(added, PAPER) == set(deviation.options)
        assert differing(undone, PAPER) == differing(DEFAULT, PAPER) - set(deviation.options)
