"""Every example in a docstring gives what it says."""

from __future__ import annotations

import doctest
import importlib
import inspect
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("reference_sim", "snug", "benchmarks", "reports")
EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for layer in LAYERS
    for path in sorted((ROOT / layer).rglob("*.py"))
    if ">>>" in path.read_text(encoding="utf-8")
]
FACES = sorted(
    ".".join(stub.parent.relative_to(ROOT).parts)
    for layer in LAYERS
    for stub in (ROOT / layer).rglob("__init__.pyi")
)


@pytest.mark.parametrize("module", EXAMPLES)
def test_the_examples_of_a_module_give_what_they_say(module):
    loaded = importlib.import_module(module)
    assert any(
        test.examples for test in doctest.DocTestFinder().find(loaded)
    )  # else numba's wrapper hides them
    assert doctest.testmod(loaded).failed == 0


def test_every_layer_has_examples():
    assert {module.partition(".")[0] for module in EXAMPLES} == set(LAYERS)


@pytest.mark.parametrize("face", FACES)
def test_a_face_gives_what_it_names_and_its_functions_have_examples(face):
    package = importlib.import_module(face)
    public = [getattr(package, name) for name in package.__all__]
    functions = [thing for thing in public if inspect.isfunction(thing)]
    assert public
    assert [thing.__name__ for thing in functions if ">>> " not in (thing.__doc__ or "")] == []
