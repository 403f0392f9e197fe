"""Every example in a docstring gives what it says."""

from __future__ import annotations

import doctest
import importlib
import inspect

import pytest

from tests.project.test_layers import LAYERS, ROOT, modules_of

EXAMPLES = [name for layer in LAYERS for name, source in modules_of(layer).items() if ">>>" in source]
STUBS = [stub for layer in LAYERS for stub in sorted((ROOT / layer).rglob("__init__.pyi"))]
FACES = [".".join(stub.parent.relative_to(ROOT).parts) for stub in STUBS]


@pytest.mark.parametrize("module", EXAMPLES)
def test_the_examples_of_a_module_give_what_they_say(module):
    loaded = importlib.import_module(module)
    examples = doctest.DocTestFinder().find(loaded)
    assert any(test.examples for test in examples)  # else numba's wrapper hides them
    assert doctest.testmod(loaded, optionflags=doctest.ELLIPSIS).failed == 0


@pytest.mark.parametrize("face", FACES)
def test_a_face_gives_what_it_names_and_its_functions_have_examples(face):
    package = importlib.import_module(face)
    public = [getattr(package, name) for name in package.__all__]
    functions = [member for member in public if inspect.isfunction(member)]
    assert public
    assert [member.__name__ for member in functions if ">>> " not in (member.__doc__ or "")] == []
