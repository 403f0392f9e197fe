"""The architecture's rules of which package may import which, checked on the syntax tree."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("reference_sim", "snug", "benchmarks", "reports")

# What each layer may import of ours. An entry also allows what lies below it.
ALLOWED = {
    "reference_sim": ("reference_sim",),
    "snug": ("snug", "reference_sim"),
    "benchmarks": ("benchmarks", "snug", "reference_sim"),
    "reports": (
        "reports",
        "benchmarks.results",
        "benchmarks.metric.Metric",
        "benchmarks.metrics.curvature",
        "reference_sim.command_line",
        "reference_sim.trajectory",
        "reference_sim.files.array_file",
        "reference_sim.files.atomic_files",
        "reference_sim.geometry.surface",
        "reference_sim.geometry.topology",
        "reference_sim.obstacle",
        "snug.motion.library",  # what recorded motions show, in words
    ),
}
# The referee's solvers are not for the contestants.
FORBIDDEN = {"snug": ("reference_sim.minimise", "reference_sim.simulate", "reference_sim.time_loop")}
# The documents list texts of the code.
LISTING = ("reports.text.published_parts",)
# A run ends by making the report of the run that it wrote, a score by the table of its own.
EXCEPTIONS = {
    ("benchmarks.runner.execute_plan", "reports.build.build_report"),
    *((f"benchmarks.{command}", "reports.build.build_row") for command in ("score", "submit")),
    ("benchmarks.submit", "reports.build.save_still"),
}
# Headline geometry must not share an error with the physics.
PURE = ("benchmarks.metrics.curvature", "benchmarks.metrics.penetration_and_distances")
DECLARATIONS = ("benchmarks.metric.Measurements", "benchmarks.metric.metrics_of")  # no physics


def modules_of(layer: str) -> dict[str, str]:
    """Module name -> source."""
    modules = {}
    for path in sorted((ROOT / layer).rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        modules[name.removesuffix(".__init__")] = path.read_text(encoding="utf-8")
    return modules


def imports(node: ast.AST) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of everything imported; without those for the type checker alone."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from ((child.lineno, alias.name) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):  # ruff bans relative ones
            yield from ((child.lineno, f"{child.module}.{alias.name}") for alias in child.names)
        elif not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)):
            yield from imports(child)


@cache
def imports_of(source: str) -> list[tuple[int, str]]:
    return list(imports(ast.parse(source)))


def within(name: str, roots: tuple[str, ...]) -> bool:
    return any(name == root or name.startswith(root + ".") for root in roots)


def complaints(module: str, source: str) -> list[str]:
    """Every import of the module that breaks a rule."""
    layer = module.partition(".")[0]
    wrong = []
    for line, name in imports_of(source):
        ours = within(name, LAYERS)
        allowed = within(name, ALLOWED[layer]) or (module, name) in EXCEPTIONS or module in LISTING
        pure = module not in PURE or name in DECLARATIONS
        if (ours and not (allowed and pure)) or within(name, FORBIDDEN.get(layer, ())):
            wrong.append(f"{module}:{line}: must not import {name}")
    return wrong


@pytest.mark.parametrize("layer", LAYERS)
def test_imports_follow_the_layers(layer):
    modules = modules_of(layer)
    assert modules and [wrong for module in modules.items() for wrong in complaints(*module)] == []


@pytest.mark.parametrize(
    ("module", "source", "found"),
    [
        ("reference_sim.a", "def f():\n    import snug", True),
        ("snug.a", "from reference_sim import Cloth", False),
        ("snug.a", "from reference_sim import simulate", True),
        ("benchmarks.plan.plan", "from reports.build import build_report", True),
        ("benchmarks.runner.execute_plan", "from reports.build import build_report", False),
        (PURE[1], "from reference_sim import Potential", True),
        (PURE[1], "if TYPE_CHECKING:\n    from reference_sim import Obstacle", False),
    ],
)
def test_a_planted_import_is_found(module, source, found):
    assert bool(complaints(module, source)) == found


STUDIES = sorted((ROOT / "studies").glob("*/*.py"))
# What a study may import of ours, as docs/extend.md promises: these, and names of the faces.
DOOR = ("benchmarks.meshes", "benchmarks.validation", "reference_sim.energies", "reference_sim.time_loop")


def test_studies_enter_by_the_public_door_and_no_layer_imports_one():
    stubs = {layer: (ROOT / layer / "__init__.pyi").read_text() for layer in LAYERS}
    faces = {
        f"{layer}.{name}"
        for layer, stub in stubs.items()
        for name in re.findall(r" as (\w+)$", stub, re.M)
    }
    for path in (path for path in STUDIES if not path.name.startswith("test_")):
        for _, name in imports_of(path.read_text(encoding="utf-8")):
            assert name in faces or within(name, DOOR) or not within(name, LAYERS), f"{path}: {name}"
    studies = ("studies", *(path.stem for path in STUDIES))
    modules = [source for layer in LAYERS for source in modules_of(layer).values()]
    assert not [name for source in modules for _, name in imports_of(source) if within(name, studies)]


def in_order(modules: Mapping[str, str], depth: int) -> list[str]:
    """Sort modules (name -> source) from the ground up; raise CycleError where two import each other.

    depth: parts of a name that are told apart; with 2 these are rooms, folders or modules of a layer, and
    the layer's own face counts no more. Imports inside functions count too.
    """
    graph: dict[str, set[str]] = {}
    for module, source in modules.items():
        parts = [
            name.rpartition(".")[0] if name not in modules else name for _, name in imports_of(source)
        ]
        nodes = [".".join(name.split(".")[:depth]) for name in [module, *parts] if name in modules]
        graph.setdefault(nodes[0], set()).update(set(nodes) - {nodes[0]})
    if depth == 2:
        graph = {room: above - {room.partition(".")[0]} for room, above in graph.items() if "." in room}
    return list(TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("layer", LAYERS)
def test_no_two_rooms_import_each_other(layer):
    order = in_order(modules_of(layer), 2)
    print("\n", layer, ":", " < ".join(order))  # pytest -s shows from the ground up who may import whom
    assert len(order) > 5


def test_no_module_imports_itself_by_a_circle():
    modules = {name: source for layer in LAYERS for name, source in modules_of(layer).items()}
    assert len(modules) > 150 and in_order(modules, 9)
