"""The site's page of a published run: its numbers are those of its files, and its links lead somewhere."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

from reports.docs import ROOT
from reports.statistics.outcomes import PUBLISHED
from reports.text import run_page
from reports.text.run_page import write_run_pages

RUN = "paper_text"  # the smallest run with a headline and a training


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> tuple[Path, str]:
    published = tmp_path_factory.mktemp("site") / "published"
    published.mkdir()
    (published / RUN).symlink_to(PUBLISHED / RUN, target_is_directory=True)
    (path,) = write_run_pages(published, published.parent / "docs" / "runs")
    return path, path.read_text(encoding="utf-8")


def test_every_link_of_a_run_page_leads_to_a_file(page):
    path, text = page
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert len(links) > 10 and all((path.parent / link).is_file() for link in links)


def test_a_run_page_has_commit_command_headline_and_the_numbers_of_its_tables(page):
    _, text = page
    commit = json.loads((PUBLISHED / RUN / "run.json").read_text(encoding="utf-8"))["commit"]
    assert f"# Run {RUN}" in text and commit in text
    assert "python -m benchmarks.run --preset paper" in text
    assert re.search(r"^- How near: On 22 unseen motions", text, re.M)
    with open(PUBLISHED / RUN / "tables" / "energies.csv", encoding="utf-8", newline="") as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    (line,) = re.findall(r"^\| tshirt \| Simulation \| (\S+) ", text.split("## Energies")[1], re.M)[:1]
    assert float(line) == pytest.approx(float(rows["simulation"]["energy/strain [J]"]), rel=5e-3)


def test_long_tables_are_files_alone(page, monkeypatch):
    _, text = page
    assert "## Energies\n" in text  # 4 lines
    monkeypatch.setattr(run_page, "MOST_LINES", 0)
    assert "##" not in run_page.run_page(PUBLISHED / RUN, "run").split("# Run", 1)[1]


def test_the_site_has_every_face_of_the_packages_and_every_document():
    pages = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs/api").glob("*.md")))
    listed = set(re.findall(r"automodule:: (\S+)", pages))
    packages = ("snug", "reference_sim", "benchmarks", "reports")
    stubs = [stub for package in packages for stub in (ROOT / package).rglob("*.pyi")]
    faces = {".".join(stub.relative_to(ROOT).parts[:-1]) for stub in stubs}
    assert faces <= listed
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^([\w/-]+)$", index, re.M))
    assert {path.stem for path in (ROOT / "docs").glob("*.md")} - {"index"} <= named
