"""The documents: examples run as written, links lead somewhere, definitions are those of the code."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.metrics import declared

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
EXTEND = ROOT / "docs" / "extend.md"
NEW_FILE = re.compile(r"New file `([^`]+)`:$")
INSERTION = re.compile(r"In `([^`]+)`, (below|above) `([^`]+)`:$")
SHORT = ("A scene", "A method", "A metric")
LONG = ("A recipe", "A garment", "A body")  # these simulate a body, or train
RUNS = (*SHORT, *LONG)


def blocks(text: str) -> Iterator[tuple[str, str, str]]:
    """(line before, language, content) of each block of code."""
    for found in re.finditer(r"(?:^([^\n]*)\n\n?)?^```(\w*)\n(.*?)^```$", text, re.M | re.S):
        yield (found[1] or "").strip(), found[2], found[3]


def sections(text: str) -> dict[str, str]:
    """Title -> text, of the parts under "## "."""
    parts = re.split(r"^## (.+)$", text, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2]))


SECTIONS = sections(EXTEND.read_text(encoding="utf-8"))


def apply(section: str, root: Path) -> None:
    """Make the files and insert the lines that a section shows."""
    for before, _, content in blocks(section):
        if found := NEW_FILE.search(before):
            path = root / found[1]
            assert path.parent.is_dir() and not path.exists(), f"{found[1]} is no new file"
            path.write_text(content, encoding="utf-8")
        elif found := INSERTION.search(before):
            path, line = root / found[1], found[3]
            lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
            assert lines.count(line + "\n") == 1, f"{found[1]} has not one line {line!r}"
            place = lines.index(line + "\n") + (found[2] == "below")
            path.write_text("".join([*lines[:place], content, *lines[place:]]), encoding="utf-8")


@pytest.fixture(scope="module")
def extended(tmp_path_factory) -> Path:
    """A copy of the project to which every example has been added."""
    root = tmp_path_factory.mktemp("extended")
    for layer in ("reference_sim", "snug", "benchmarks", "reports", "tests"):
        shutil.copytree(ROOT / layer, root / layer, ignore=shutil.ignore_patterns("published", "runs"))
    shutil.copy(ROOT / "pyproject.toml", root)
    for section in SECTIONS.values():
        apply(section, root)
    return root


def run(root: Path, *command: str) -> None:
    environment = os.environ | {"PYTHONPATH": str(root), "MPLBACKEND": "Agg"}
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"


def commands(root: Path, title: str, out: Path | None = None) -> None:
    """Run the scripts and commands of a section, in their order."""
    for before, language, content in blocks(SECTIONS[title]):
        if language == "sh":
            line = content.replace("python ", f"{sys.executable} ").replace("DIR", str(out))
            run(root, "bash", "-ec", line)
        elif not (NEW_FILE.search(before) or INSERTION.search(before)):
            run(root, sys.executable, "-c", content)


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "results.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("title", [*SHORT, *(pytest.param(title, marks=pytest.mark.slow) for title in LONG)])
def test_an_example_of_extending_runs_as_written(title, extended, tmp_path):
    if title == "A garment":
        from snug.body import Body
        from snug.garment_kinds import tailor_tshirt

        shirt = tailor_tshirt(Body.load(), vertices=300)
        lines = [f"v {x} {y} {z}" for x, y, z in shirt.rest_positions.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (shirt.faces + 1).tolist()]
        (extended / "cape.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    commands(extended, title, tmp_path)
    rows = rows_of(tmp_path)
    assert rows and all(row["status"] == "ok" for row in rows)
    if title == "A scene":
        assert {row["scene"] for row in rows} == {"curtain"}
        # The section on energies gives the curtain its wind, which does work on it.
        wind = {row["method"]: float(row["value"]) for row in rows if row["metric"] == "energy/wind"}
        assert wind.keys() == {"simulation", "newton-1"} and max(wind.values()) < 0.0
    if title == "A method":
        total = {row["method"]: float(row["value"]) for row in rows if row["metric"] == "energy/total"}
        # In n frames backward Euler falls (n + 1) / n times as far.
        assert total["explicit-200"] == pytest.approx(total["simulation"], rel=0.2)
    if title == "A metric":
        assert {row["unit"] for row in rows if row["metric"] == "height/lowest"} == {"m"}
        table = (tmp_path / "tables" / "height_by_scene.csv").read_text(encoding="utf-8")
        assert table.startswith("suite,scene,method,height/lowest [m],")
    if title == "A recipe":
        assert "snug-window4" in {row["method"] for row in rows}
    if title == "A garment":
        assert {row["garment"] for row in rows} == {"cape"}


def test_the_example_of_an_energy_runs_as_written(extended):
    commands(extended, "An energy")


def test_lines_to_insert_are_no_python_of_their_own():
    """ruff formats Python in documents: it would make a tuple of a line that belongs into one."""
    for section in SECTIONS.values():
        for before, language, content in blocks(section):
            assert not INSERTION.search(before) or language == "text", content


def test_every_example_is_tested():
    examples = {title for title, text in SECTIONS.items() if "```" in text}
    assert examples == {*RUNS, "An energy"}


def test_every_metric_is_defined_as_declared():
    text = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    escaped = {name: metric.definition.replace("|", "\\|") for name, metric in declared().items()}
    lines = [f"| `{name}` | {metric.unit} | {escaped[name]} |" for name, metric in declared().items()]
    table = re.findall(r"^\| `[^`|]+/[^`|]+` \|.*$", text, re.M)
    assert not [line for line in lines if line not in table], "add these lines to the table"
    assert not [line for line in table if line not in lines], "remove these lines from the table"


def heading_anchors(path: Path) -> set[str]:
    """What GitHub makes of the headings of a document."""
    titles = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(path):
    for link in re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8")):
        if not link.startswith(("http://", "https://")):
            name, _, anchor = link.partition("#")
            target = path.parent / name if name else path
            assert target.exists(), f"{path.name}: {link}"
            assert not anchor or anchor in heading_anchors(target), f"{path.name}: {link}"
