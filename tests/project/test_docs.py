"""The documents: examples run as written, links lead somewhere, tables are narrow."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import run as benchmarks_run
from tests.benchmarks.plan.outside_files import as_before
from tests.benchmarks.runner.tasks_by_hand import run_in_this_process

_as_before = pytest.fixture(autouse=True)(as_before)

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("studies/*/*.md")])
DOCS = ROOT / "docs"
EXTEND, TASKS, EXAMPLES = DOCS / "extend.md", DOCS / "tasks.md", DOCS / "examples"
FILE = re.compile(r"File `([^`]+)`:$")
# As written they are run by -m slow; in one run by TOGETHER.
JOINED = ("A method", "A scene", "A metric")
TOGETHER = (
    "smoke --scenes hanging_sheet,./curtain.py"
    " --methods simulation,newton-1,./held.py,./explicit.py --set metrics=./height.py -o "
)
# Last words of the sections whose commands leave no results.
LAST_WORDS = {
    "How to add something": "nothing is wrong\n",
    "An energy": "its lowest point is at y = -0.396 m\n",
}
# Fewer frames, cells and steps, and no GPU.
SMALLER = {
    "cells=20, size": "cells=4, size",
    r"pins=\[0, 20\]": "pins=[0, 4]",
    "frames=60": "frames=3",
    r"^(python -m benchmarks\.(?:export|run full|score).*)$": r"\1 --set sizes.frames=14",
    r'make_motion\("dance_turn"\)': r"\g<0>.cut(0, 14)",
    "steps=4000": "steps=2",
    "--device cuda": "--device cpu --steps 2",
    '"reports/published': f'"{ROOT}/reports/published',
}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(text: str) -> Iterator[tuple[str, str, str]]:
    """(line before, language, content) of each block of code."""
    for match in re.finditer(r"(?:^([^\n]*)\n\n?)?^```(\w*)\n(.*?)^```$", text, re.M | re.S):
        yield (match[1] or "").strip(), match[2], match[3]


PARTS = re.split(r"^##? (.+)$", EXTEND.read_text(encoding="utf-8"), flags=re.M)
SECTIONS = dict(zip(PARTS[1::2], PARTS[2::2]))
EXAMPLE_SECTIONS = [title for title, text in SECTIONS.items() if "```sh" in text]


@pytest.fixture(scope="module")
def user(tmp_path_factory) -> Path:
    """A user's folder with every file of the document and every example."""
    folder = tmp_path_factory.mktemp("a user")  # paths may have spaces
    for path in EXAMPLES.glob("*.py"):
        (folder / path.name).write_bytes(path.read_bytes())
    for document in (EXTEND, TASKS):
        for before, _, content in blocks(document.read_text(encoding="utf-8")):
            if match := FILE.search(before):
                (folder / match[1]).write_text(content, encoding="utf-8")
    return folder


def smaller(code: str) -> str:
    """Make a block of README or of the ten tasks quick."""
    for whole, part in SMALLER.items():
        code = re.sub(whole, part, code, flags=re.M)
    return code


def run(folder: Path, line: str) -> str:
    """Run a line as it stands in a user's folder, and return what it prints."""
    search_path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PATH": search_path, "MPLBACKEND": "Agg"}
    command = ["bash", "-ec", line]
    process = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert process.returncode == 0, f"{line}\n{process.stdout[-2000:]}{process.stderr[-4000:]}"
    return process.stdout


def judge(title: str, folder: Path) -> None:
    """Hold the rows of a run, and its folder, to what the section says."""
    with (folder / "results.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert rows and all(row["status"] == "ok" for row in rows)

    def values(metric: str, scene: str = "") -> dict[str, float]:
        rows_found = [row for row in rows if row["metric"] == metric and scene in ("", row["scene"])]
        return {row["method"]: float(row["value"]) for row in rows_found}

    if title == "A method":
        total = values("energy/total", "hanging_sheet")
        # In n frames backward Euler falls (n + 1) / n times as far.
        assert total["explicit-200"] == pytest.approx(total["simulation"], rel=0.2)
        assert total["held"] > total["simulation"]  # it keeps its height
    elif title == "A network of your own":
        skinned = values("energy/strain")
        assert skinned["pose-network"] != skinned["skinning"] > 0.0  # a little trained, on another motion
    elif title == "A program":
        off = values("exact/distance")
        assert off.keys() == {"simulation", "fall"} and max(off.values()) < 1e-9
    elif title == "A scene":
        # The section on energies gives the curtain its wind, which does work on it.
        wind = values("energy/wind", "curtain")
        assert wind["simulation"] < 0.0 > wind["newton-1"]
        assert {row["scene"] for row in rows if row["metric"] == "energy/wind"} == {"curtain"}
    elif title == "A metric":
        assert {row["unit"] for row in rows if row["metric"] == "height/lowest"} == {"m"}
        table = (folder / "tables" / "height_by_scene.csv").read_text(encoding="utf-8")
        assert table.startswith("suite,scene,method,height/lowest [m],")
    elif title == "A recipe":
        assert {row["method"] for row in rows} == {"snug-windy"}
    elif title == "A known answer":
        assert values("check", "sheet_at_rest") == {"simulation": pytest.approx(0.0, abs=1e-12)}
        assert values("height/lowest", "curtain").keys() == {"simulation", "held"}
    else:
        pytest.fail(f"nothing is expected of the section {title!r}")


@pytest.mark.slow
@pytest.mark.parametrize("title", EXAMPLE_SECTIONS)
def test_an_example_of_extending_runs_as_written(title, user, tmp_path):
    shells = [content for _, language, content in blocks(SECTIONS[title]) if language == "sh"]
    *_, output = [run(user, content.replace("DIR", str(tmp_path)).rstrip()) for content in shells]
    if title in LAST_WORDS:
        assert output.endswith(LAST_WORDS[title])
    else:
        judge(title, tmp_path)


def test_a_method_a_scene_and_a_metric_of_the_examples_run_together(user, tmp_path, monkeypatch):
    run_in_this_process(monkeypatch)
    monkeypatch.chdir(user)
    assert benchmarks_run.main([*TOGETHER.split(), str(tmp_path)]) == 0
    for title in JOINED:
        judge(title, tmp_path)


def test_the_lines_of_python_in_the_readme_print_what_it_says(tmp_path, monkeypatch, capsys):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = [text for _, language, text in blocks(readme) if language == "python"]
    monkeypatch.chdir(tmp_path)
    exec(smaller(code), {"__name__": "__main__"})
    assert capsys.readouterr().out == code.rpartition("# ")[2]


@pytest.mark.slow
def test_the_ten_tasks_run_as_written(user, tmp_path):
    (tmp_path / "height.py").write_bytes((user / "height.py").read_bytes())
    printed = ""
    for before, language, text in blocks(TASKS.read_text(encoding="utf-8")):
        if not FILE.search(before):
            code = {"sh": "{}", "python": "python - << 'END'\n{}END"}[language]
            printed += run(tmp_path, code.format(smaller(text)))
    assert re.search(r"^strain +0\.1560\d* +0\.0506", printed, re.M)  # table 1, as in the results
    assert (tmp_path / "beside.png").is_file() and (tmp_path / "gpu.safetensors").is_file()


def heading_anchors(path: Path) -> set[str]:
    """Return the anchors that GitHub makes of a document's headings."""
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


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_has_narrow_tables_and_leading_zeros(path):
    text = re.sub(r"^```.*?^```$|`[^`\n]*`", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    assert [line for line in text.splitlines() if line.startswith("|") and line.count(" | ") >= 7] == []
    assert re.findall(r"(?<![\w./*{,-])\.\d+\b", text) == [], "a decimal lacks its leading zero"
