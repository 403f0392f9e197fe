"""The page of entries: one protocol and one set of scenes a table, sorted, safe with any title."""

from __future__ import annotations

import json
import re

import pytest

from benchmarks.provenance import digest_of_file
from benchmarks.results.row import DECLARED, ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.entries import entries_tables, full_scenes, load_entry, page_of
from reports.finished_run import read_run
from tests.reports.report_folder import row, run_folder

TOTAL = {"simulation": 1.0, "skinning": 9.0}
FULL = ("tshirt/a", "tshirt/b")
NASTY = "</script><script>window.hacked=1</script>"


def write_run(path, totals, scenes, protocol, **config):
    numbers = {"penetration/surface": 0.5, "cost/frame": 2.0}
    reasons = {"cost/frame": DECLARED} if "metadata" in config else {}
    rows = [
        row(scene, name, metric, value, protocol=protocol, reason=reasons.get(metric, ""))
        for scene in scenes
        for name, total in (TOTAL | totals).items()
        for total in [total[scene] if isinstance(total, dict) else total]
        for metric, value in {"energy/total": total, **numbers}.items()
    ]
    path.mkdir(parents=True)
    return read_run(run_folder(path, rows, **config))


@pytest.fixture
def published(tmp_path):
    motions = {"test tshirt": ["a", "b", "c"]}
    fields = {"motions": motions, "preset_values": {"test_motions": 2}}
    scenes = (*FULL, "tshirt/c")
    return write_run(tmp_path / "published", {"snug": 1.8}, scenes, "1.0", **fields)


def write_entry(root, name, total, *, scenes=FULL, protocol="1.0"):
    (root / name).mkdir(parents=True)
    (root / name / "entry.toml").write_text("")
    metadata = {"title": f"{name} {NASTY}", "authors": "they", "training_data": "none"}
    write_run(root / name / "scores", {name: total}, scenes, protocol, metadata=metadata)
    return root / name


def test_a_table_has_one_protocol_and_one_set_of_scenes_and_is_sorted(tmp_path, published):
    files = [
        write_entry(tmp_path / "in", "worse", 3.0),
        write_entry(tmp_path / "in", "better", 1.08),
        write_entry(tmp_path / "in", "part", 1.0, scenes=FULL[:1]),
        write_entry(tmp_path / "in", "old", 1.0, protocol="0.9"),
        write_entry(tmp_path / "in", "fallen", {"tshirt/a": 1.0, "tshirt/b": -20.0}),
    ]
    assert full_scenes(published) == FULL
    tables = [table for table, _ in entries_tables([*map(load_entry, files)], "quick", published)]
    assert {table.caption: [line[1].split()[0] for line in table.rows] for table in tables} == {
        "Protocol 0.9; scenes: all.": ["old"],
        "Protocol 1.0; scenes: all.": ["better", "SNUG", "worse", "Skinning", "fallen"],
        "Protocol 1.0; scenes: 1 of 2: tshirt/a.": ["part", "SNUG", "Skinning"],
    }
    lines = {line[1].split()[0]: line for table in tables for line in table.rows}
    assert lines["better"][2].shown == pytest.approx(1.0) and lines["worse"][2].interval is None
    assert (lines["better"][6], lines["SNUG"][6]) == ("declared", "measured")
    assert (lines["better"][0], lines["worse"][0]) == (1, 3)
    proofs = {line[8] for name, line in lines.items() if name != "SNUG"}
    assert proofs == {"declared", "verified from vertices"}
    page = page_of(tmp_path / "in", "quick", published)
    assert "<script>window" not in page
    content = json.loads(re.search(r'id="content">(.*?)</script>', page, re.DOTALL)[1])
    assert f"better {NASTY}; they" in json.dumps(content, ensure_ascii=False)


def test_a_roll_out_that_fell_off_is_seen_in_an_entry_of_few_motions(tmp_path):
    entry = load_entry(write_entry(tmp_path, "mine", {"tshirt/a": 1.8, "tshirt/b": -20.0}))
    assert entry.cells()[2].shown == pytest.approx(10.0) and not entry.cells()[2].complete


def test_scores_of_files_as_they_were_scored_are_marked_by_who_made_them(tmp_path):
    folder, scores = write_entry(tmp_path, "mine", 2.0), RunFolder(tmp_path / "mine" / "scores")
    (folder / "x.npz").write_text("frames")
    files = {"entry": {"x.npz": digest_of_file(folder / "x.npz")}, "roll_outs": {"a-seed0": "12"}}
    config = scores.read_config() | files | {"commit": "abc", "date": "2026-11-29"}
    for program, proof in (("", "files only"), ("method.py", "verified from vertices")):
        url = {"url": "https://example.org/mine"}
        scores.write_config(config | {"metadata": config["metadata"] | url | {"program": program}})
        (scores.path / "picture.png").write_bytes(b"png")
        cells, title = load_entry(folder).cells(), load_entry(folder).title_cell()
        assert cells[8:11] == (proof, "abc", "2026-11-29") and len(cells[11]) == 8
        assert title[4:] == ["https://example.org/mine", "data:image/png;base64,cG5n"]
    (folder / "x.npz").write_text("other frames")
    assert load_entry(folder).cells()[8] == "declared"


def test_scores_of_another_entry_or_of_none_are_refused_with_what_to_do(tmp_path, published):
    folder = tmp_path / "in"
    write_entry(folder, "old", 2.0)
    scores = RunFolder(folder / "old" / "scores")
    again = r".* benchmarks.submit score .*"
    (folder / "old").rename(folder / "new")
    with pytest.raises(ResultsError, match=f"no scores of 'new'{again}"):
        page_of(folder, "quick", published)
    (folder / "new").rename(folder / "old")
    scores.write_config({k: value for k, value in scores.read_config().items() if k != "metadata"})
    with pytest.raises(ResultsError, match=f"run.json: .*no metadata{again}"):
        page_of(folder, "quick", published)
    scores.config_path.unlink()
    with pytest.raises(ResultsError, match=f"old: has no scores{again}"):
        page_of(folder, "quick", published)
