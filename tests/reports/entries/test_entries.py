"""The page of entries: one protocol and one set of scenes a table, sorted, safe with any title."""

from __future__ import annotations

import dataclasses
import json
import re

import pytest

from benchmarks.results.row import DECLARED, ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.entries import entries_tables, full_scenes, main, of_entry, page_of
from reports.run.reading import read_run
from tests.reports.report_folder import row, run_folder

TOTAL = {"simulation": 1.0, "skinning": 9.0}
FULL = ("tshirt/a", "tshirt/b")
NASTY = "</script><script>window.hacked=1</script>"


def write_run(path, totals, scenes, protocol, **config):
    rows = []
    for scene in scenes:
        for name, total in (TOTAL | totals).items():
            numbers = {"energy/total": total, "penetration/surface": 0.5, "cost/frame": 2.0}
            rows += [
                dataclasses.replace(
                    row(scene, name, metric, value),
                    protocol=protocol,
                    reason=DECLARED if metric == "cost/frame" and "metadata" in config else "",
                )
                for metric, value in numbers.items()
            ]
    path.mkdir(parents=True)
    folder = run_folder(path, rows, **config)
    return folder, read_run(folder)


@pytest.fixture
def published(tmp_path):
    motions = {"test tshirt": ["a", "b", "c"]}
    more = {"motions": motions, "preset_values": {"test_motions": 2}}
    scenes = (*FULL, "tshirt/c")
    return write_run(tmp_path / "published", {"snug": 1.8}, scenes, "1.0", **more)


def write_entry(root, name, total, *, scenes=FULL, protocol="1.0"):
    (root / name).mkdir(parents=True)
    (root / name / "entry.toml").write_text("")
    metadata = {"title": f"{name} {NASTY}", "authors": "they", "training_data": "none"}
    return write_run(root / name / "scores", {name: total}, scenes, protocol, metadata=metadata)


def test_a_table_has_one_protocol_and_one_set_of_scenes_and_is_sorted(tmp_path, published):
    made = [
        write_entry(tmp_path / "in", "worse", 3.0),
        write_entry(tmp_path / "in", "better", 1.08),
        write_entry(tmp_path / "in", "part", 1.0, scenes=FULL[:1]),
        write_entry(tmp_path / "in", "old", 1.0, protocol="0.9"),
    ]
    tables = entries_tables([of_entry(*entry) for entry in made], published)
    assert full_scenes(published[1]) == FULL
    names = {table.caption: [entry.method for entry in scored] for table, scored in tables}
    assert names == {
        "Protocol 0.9; scenes: all.": ["old"],
        "Protocol 1.0; scenes: all.": ["better", "snug", "worse", "skinning"],
        "Protocol 1.0; scenes: 1 of 2: tshirt/a.": ["part", "snug", "skinning"],
    }
    lines = {line[0].split()[0]: line for table, _ in tables for line in table.rows}
    assert lines["better"][1] == pytest.approx(1.0) and lines["worse"][1] == pytest.approx(25.0)
    assert (lines["better"][5], lines["SNUG"][5]) == ("declared", "measured")


def test_a_row_links_to_its_roll_out_where_a_page_is_kept(tmp_path, published):
    folder, run = write_entry(tmp_path / "in", "mine", 2.0)
    page = tmp_path / "in" / "index.html"
    assert of_entry(folder, run).link(page) == ""
    folder.page_path.write_text("")
    address = "mine/scores/report.html#scene=tshirt%2Fa&methods=simulation%2Cmine"
    assert of_entry(folder, run).link(page) == address
    text, without = page_of(tmp_path / "in", page, published)
    assert json.dumps(address)[1:-1] in text and without == [] and "<script>window" not in text
    (table,) = json.loads(re.search(r'id="content">(.*?)</script>', text, re.DOTALL)[1])
    assert table["rows"][1][0] == [f"mine {NASTY}; they"] * 2 + ["", "", address]


def test_scores_of_another_entry_or_of_none_are_refused_with_what_to_do(tmp_path, published):
    folder = tmp_path / "in"
    write_entry(folder, "old", 2.0)
    (folder / "old").rename(folder / "new")
    with pytest.raises(ResultsError, match=r"no scores of 'new'.* benchmarks.submit score .*new --replace"):
        page_of(folder, folder / "index.html", published)
    (folder / "new").rename(folder / "old")
    scores = RunFolder(folder / "old" / "scores")
    scores.write_config({k: value for k, value in scores.read_config().items() if k != "metadata"})
    with pytest.raises(ResultsError, match=r"run.json: .*no metadata.* benchmarks.submit score .*old"):
        page_of(folder, folder / "index.html", published)


def test_entries_without_scores_are_named_and_no_entry_is_refused(tmp_path, published):
    assert main([str(tmp_path)]) == 2
    write_entry(tmp_path / "in", "mine", 2.0)
    (tmp_path / "in" / "new").mkdir()
    (tmp_path / "in" / "new" / "entry.toml").write_text("")
    _, without = page_of(tmp_path / "in", tmp_path / "page.html", published)
    assert [path.name for path in without] == ["new"]
