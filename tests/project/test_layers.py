"""The architecture's rules of which package may import which, checked on the syntax tree."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
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
    ),
}
# The referee's solvers are not for the contestants.
FORBIDDEN = {"snug": ("reference_sim.minimise", "reference_sim.simulate", "reference_sim.time_loop")}
# A run ends by making the report of the run that it wrote; the documents list texts of the code.
EXCEPTIONS = {
    ("benchmarks/runner/execute_plan.py", "reports.build.build_report"),
    ("reports/text/code_parts.py", "benchmarks.metrics.declared"),
    ("reports/text/code_parts.py", "benchmarks.plan.options.make_parser"),
    ("reports/text/code_parts.py", "benchmarks.declarations.attributes_of"),
    ("reports/text/code_parts.py", "benchmarks.plan.study.PACKAGED"),
    ("reports/text/code_parts.py", "benchmarks.plan.study.read_study"),
    ("reports/text/code_parts.py", "benchmarks.presets.PRESETS"),
    ("reports/text/code_parts.py", "snug.named_recipes.RECIPES"),
    ("reports/text/code_parts.py", "snug.motion.library.source_rows"),
}
# Headline geometry must not share an error with the physics.
PURE = ("benchmarks/metrics/curvature.py", "benchmarks/metrics/penetration_and_distances.py")
DECLARATIONS = ("benchmarks.metric.Measurements", "benchmarks.metric.metrics_of")  # no physics


def files_of(layer: str) -> list[Path]:
    return sorted((ROOT / layer).rglob("*.py"))


def imports(tree: ast.Module, package: str) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of everything imported; without those for the type checker alone."""
    for node in _walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, *([base] if base else [])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def _walk(node: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            continue
        yield child
        yield from _walk(child)


def within(name: str, roots: tuple[str, ...]) -> bool:
    return any(name == root or name.startswith(root + ".") for root in roots)


def complaints(relative: str, source: str) -> list[str]:
    """Every import of the file that breaks a rule."""
    layer = relative.split("/")[0]
    package = ".".join(Path(relative).parent.parts)
    tree = ast.parse(source)
    wrong = []
    for line, name in imports(tree, package):
        ours = name.split(".")[0] in LAYERS
        if ours and not within(name, ALLOWED[layer]) and (relative, name) not in EXCEPTIONS:
            wrong.append(f"{relative}:{line}: {layer} must not import {name}")
        if within(name, FORBIDDEN.get(layer, ())):
            wrong.append(f"{relative}:{line}: {layer} must not import {name}")
        if relative in PURE and within(name, LAYERS) and name not in DECLARATIONS:
            wrong.append(f"{relative}:{line}: a geometry metric must not import {name}")
    return wrong


@pytest.mark.parametrize("layer", LAYERS)
def test_imports_follow_the_layers(layer):
    files = files_of(layer)
    assert files, f"no module in {layer}"
    wrong = []
    for path in files:
        wrong += complaints(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    assert not wrong, "\n".join(wrong)


def test_the_named_files_exist():
    named = (*PURE, *(path for path, _ in EXCEPTIONS))
    assert [path for path in named if not (ROOT / path).is_file()] == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("reference_sim/a.py", "import snug"),
        ("reference_sim/energies/a.py", "def f():\n    from benchmarks import run"),
        ("snug/a.py", "from reference_sim import simulate"),
        ("snug/a.py", "from reference_sim.minimise.newton import minimise_newton"),
        ("snug/a.py", "from reports import build"),
        ("benchmarks/plan/plan.py", "from reports.build import build_report"),
        ("reports/a.py", "from benchmarks import run"),
        ("reports/a.py", "import reference_sim"),
        ("reports/a.py", "from ..snug import body"),
        ("benchmarks/metrics/penetration_and_distances.py", "from reference_sim import Potential"),
    ],
)
def test_a_planted_import_is_found(path, source):
    assert complaints(path, source)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("snug/a.py", "from reference_sim import Cloth\nfrom . import body"),
        ("snug/baselines/a.py", "from ..loss import f\nimport torch"),
        (
            "benchmarks/runner/execute_plan.py",
            "def f():\n    import torch\n    from reports.build import build_report",
        ),
        ("reports/a.py", "from benchmarks.results.run_folder import RunFolder\nfrom .tables import f"),
        ("reports/a.py", "def f():\n    from reference_sim.trajectory import Trajectory"),
        (
            "benchmarks/metrics/penetration_and_distances.py",
            "if TYPE_CHECKING:\n    from reference_sim import Obstacle",
        ),
    ],
)
def test_an_allowed_import_passes(path, source):
    assert not complaints(path, source)


STUDIES = sorted((ROOT / "studies").glob("*/*.py"))
# What a study may import of ours, as docs/extend.md promises: these, and names of the faces.
DOOR = ("benchmarks.meshes", "benchmarks.validation", "reference_sim.energies", "reference_sim.time_step")


def test_studies_enter_by_the_public_door():
    faces = {
        f"{layer}.{name}"
        for layer in LAYERS
        for name in re.findall(r" as (\w+)$", (ROOT / layer / "__init__.pyi").read_text(), re.M)
    }
    wrong = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in STUDIES
        if not path.name.startswith("test_")
        for _, name in imports(ast.parse(path.read_text(encoding="utf-8")), "")
        if name.split(".")[0] in LAYERS and name not in faces and not within(name, DOOR)
    ]
    assert STUDIES and not wrong, "\n".join(wrong)


def test_no_layer_imports_a_study():
    studies = {"studies", *(path.stem for path in STUDIES)}
    for source in (path for layer in LAYERS for path in files_of(layer)):
        for line, name in imports(ast.parse(source.read_text(encoding="utf-8")), ""):
            assert name.split(".")[0] not in studies, f"{source}:{line}"


def demand_no_circle(sources: Mapping[str, str]) -> None:
    """Raises CycleError for modules, name to source, that import each other; inside functions counts too."""
    graph: dict[str, set[str]] = {}
    for module, source in sources.items():
        inside = f"{module}."
        package = module if any(name.startswith(inside) for name in sources) else module.rpartition(".")[0]
        named = [name for _, name in imports(ast.parse(source), package)]
        modules = {name if name in sources else name.rpartition(".")[0] for name in named}
        graph[module] = modules & set(sources) - {module}
    TopologicalSorter(graph).prepare()


def sources_of(layer: str) -> dict[str, str]:
    """Module name -> source, of a layer."""
    names = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files_of(layer)}
    return {name.removesuffix(".__init__"): path.read_text(encoding="utf-8") for path, name in names.items()}


def rooms_in_order(sources: Mapping[str, str]) -> list[str]:
    """Sort the rooms of a layer from the ground up; raise CycleError where two import each other.

    A room is a folder of the layer, or a module that lies in none.
    """
    graph: dict[str, set[str]] = {}
    for module, source in sources.items():
        room = module.split(".")[1:2]
        if not room:
            continue  # the layer's own face
        above = graph.setdefault(room[0], set())
        for _, name in imports(ast.parse(source), module):
            layer, *rest = name.split(".")
            if (
                rest
                and layer == module.split(".")[0]
                and rest[0] != room[0]
                and f"{layer}.{rest[0]}" in sources
            ):
                above.add(rest[0])
    return list(TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("layer", LAYERS)
def test_no_two_rooms_import_each_other(layer):
    order = rooms_in_order(sources_of(layer))
    print("\n", layer, ":", " < ".join(order))  # pytest -s shows from the ground up who may import whom
    assert len(order) > 5


def test_a_planted_circle_of_rooms_is_found():
    sources = {
        "snug.body": "",
        "snug.body.skinning.skin": "def f():\n    from snug.motion.clip import g",
        "snug.motion": "",
        "snug.motion.clip": "from snug.body.bones import h",
    }
    with pytest.raises(CycleError):
        rooms_in_order(sources)
    assert rooms_in_order({**sources, "snug.motion.clip": ""}) == ["motion", "body"]


def test_no_folder_is_a_hall():
    """A newcomer reads a folder's names at a glance: at most 19 modules beside its face and command."""
    folders = Counter(path.parent for layer in (*LAYERS, "tests") for path in files_of(layer))
    faces = Counter(
        path.parent
        for layer in LAYERS
        for path in files_of(layer)
        if path.name in ("__init__.py", "__main__.py")
    )
    halls = {str(folder.relative_to(ROOT)): n - faces[folder] for folder, n in folders.items()}
    assert {folder: count for folder, count in halls.items() if count > 19} == {}


def test_no_module_imports_itself_by_a_circle():
    sources = {name: source for layer in LAYERS for name, source in sources_of(layer).items()}
    assert len(sources) > 150
    demand_no_circle(sources)


def test_a_planted_circle_is_found():
    one, other = "from snug.b import f", "def f():\n    from snug import a"
    with pytest.raises(CycleError):
        demand_no_circle({"snug.a": one, "snug.b": other, "snug.c": one})
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from snug.a import g"
    demand_no_circle({"snug.a": one, "snug.b": typed, "snug.c": one})
