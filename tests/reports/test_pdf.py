"""The PDF as a reader of PDFs sees it: where words lie, how large they are, how full pages are."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from reports.blocks import FIGURES, Report
from reports.figures.plotting import draw_figures
from reports.finished_run import read_run
from reports.pdf import write_pdf
from reports.tables import make_tables
from tests.reports.report_folder import SCENES, SHOWN, all_rows, row, run_folder, write_roll_outs

pdfium = pytest.importorskip("pypdfium2", reason="the test extra is not installed")

CM = 72.0 / 2.54
MARGIN = 2.0 * CM
SLACK = 1.0  # [pt] by which boxes may reach over a margin or into each other
MOST_PAGES = 8
LONG = "x" * 60 + "_with_a_name_as_long_as_a_run_lets_it_be"
HOSTILE = ("#strong[markup] $x$ *b* _i_ @ref <b>&amp;", "quo\"ted 'name' `raw`", "裙子/夏天-βήτα", LONG)


def hostile_rows():
    """More networks, stress tests and skips than there is room for, of which some have names of markup."""
    rows = all_rows()
    for k, scene in itertools.product(range(14), SCENES):
        for metric, unit in (("energy/total", "J"), ("curvature/error", "1/m"), ("cost/frame", "ms")):
            rows.append(row(scene, f"network-{k}", metric, 1.0 + k, unit=unit))
        rows.append(row(scene, f"network-{k}", "dynamics/amplitude", 1e-9 * k, unit="1"))
    skips = {"value": None, "status": "skipped", "reason": "it moves a garment with a body's joints " * 3}
    rows += [row(f"sheet_{k}", f"network-{k}", suite="speed", garment="", **skips) for k in range(20)]
    outcome = {"suite": "extremes", "method": "simulation", "metric": "outcome", "unit": "vertex weights"}
    stalled = {"value": None, "status": "stalled", "reason": "collapsed " * 30}
    rows += [row(f"case_{k}", **stalled, **outcome) for k in range(30)]
    methods = {"snug": HOSTILE[0], "pbns": LONG, "supervised": HOSTILE[2]}
    scenes = {SCENES[0]: f"tshirt/{HOSTILE[1]}", "hanging_sheet": HOSTILE[2], "stiff": LONG}
    return [
        dataclasses.replace(
            r, method=methods.get(r.method, r.method), family=methods.get(r.family, r.family),
            scene=scenes.get(r.scene, r.scene), reason=r.reason and f"{r.reason}: {HOSTILE[0]} {LONG}",
        )
        for r in rows
    ]  # fmt: skip


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The pages of a report with roll-outs."""
    rows, provenance = hostile_rows(), {"commit": "abc", "started": "2030-01-02T03:04:05+00:00"}
    run = run_folder(tmp_path_factory.mktemp("run"), rows, preset="smoke", **provenance)
    methods = {r.method for r in rows} & {*SHOWN, *HOSTILE}
    write_roll_outs(run, {r.scene for r in rows if r.garment}, methods)
    results = read_run(run)
    pictures = draw_figures(results, run.figures, FIGURES)
    write_pdf(run, Report(results, make_tables(results), pictures))
    assert not results.problems
    document = pdfium.PdfDocument(run.report_path)
    yield document
    document.close()


@pytest.fixture(scope="module")
def texts(report):
    """The words of each page."""
    return [words(page) for page in report]


def words(page) -> list[tuple[str, np.ndarray]]:
    """Each word and its box (left, bottom, right, top) [pt]."""
    text = page.get_textpage()
    word_boxes, letters, boxes = [], "", []
    for k in range(text.count_chars() + 1):
        letter = text.get_text_range(k, 1) if k < text.count_chars() else " "
        box = text.get_charbox(k) if letter.strip() else None
        apart = boxes and box is not None and (box[0] - boxes[-1][2] > 1.5 or box[0] < boxes[-1][0] - 1.0)
        if (box is None or apart) and boxes:
            edges = np.array(boxes)
            whole = np.concatenate([edges[:, :2].min(axis=0), edges[:, 2:].max(axis=0)])
            word_boxes.append((letters, whole))
            letters, boxes = "", []
        if box is not None:
            letters, boxes = letters + letter, [*boxes, box]
    return word_boxes


def test_no_word_lies_over_a_margin_or_over_another(report, texts):
    for page, word_boxes in zip(report, texts, strict=True):
        boxes = np.array([box for _, box in word_boxes])
        width, height = page.get_size()
        out = [
            word for word, box in word_boxes if box[0] < MARGIN - SLACK or box[2] > width - MARGIN + SLACK
        ]
        assert not out and boxes[:, 1].min() > 0.0 and boxes[:, 3].max() < height
        low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
        high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
        over = np.triu(((high - low) > SLACK).all(axis=-1), 1)
        assert not over.any(), [(word_boxes[a][0], word_boxes[b][0]) for a, b in np.argwhere(over)]


def test_pages_are_few_and_full(report):
    """No page but the last has a blank stretch of a third of its height, header and footer not counted."""
    assert len(report) <= MOST_PAGES
    for page in list(report)[:-1]:
        image = page.render(scale=0.5).to_numpy().min(axis=(1, 2))
        inner = image[int(0.06 * len(image)) : int(0.94 * len(image))]
        inked = np.flatnonzero(np.concatenate([[0], inner, [0]]) < 230)
        assert np.diff(inked).max() < len(image) / 3


def test_names_stand_as_they_are(texts):
    bare = "".join(word for page in texts for word, _ in page)
    bare = bare.replace("\u200b", "")  # where a line may break
    assert "裙" not in bare  # of no font: it would be an empty box
    names = ["Simulation", *HOSTILE[:2], LONG, "U+88D9U+5B50/U+590FU+5929-βήτα"]
    assert [name for name in names if "".join(name.split()) not in bare] == []
    assert "overthesegmentsofarecording" in bare  # what means are over
