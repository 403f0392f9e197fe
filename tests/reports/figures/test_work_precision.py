"""Error against run time in the report: fronts, profiles, break-even and what the summary says of them."""

from __future__ import annotations

import dataclasses

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from reports.figures.charts import break_even, error_of_page_one
from reports.figures.figure import Drawing
from reports.statistics.pareto import (
    points_of,
    run_time,
)
from tests.reports.report_folder import run_of
from tests.reports.speed_rows import SCENES, all_rows, row

# method: ms a frame, relative energy gap, curvature error
FIGURES = (error_of_page_one, break_even)


def test_run_time_is_from_pose_to_vertices_where_every_timed_cell_has_that(tmp_path):
    rows = all_rows()
    frame_times = [r for r in rows if r.metric == "cost/frame"]
    whole = [dataclasses.replace(r, metric="cost/whole", value=r.value + 2.0) for r in frame_times]
    rows.append(row(SCENES[0], "skinning", "cost/spread", 50.0, "%"))
    for added, shift in ((whole, 2.0), (whole[1:], 0.0), ([], 0.0)):
        run = run_of([*rows, *added])
        cells = run.cells("speed")
        scene = cells[cells["scene"] == SCENES[0]]
        (point,) = (
            p
            for p in points_of(run, scene, SCENES[:1], "gap/energy", run_time(scene))
            if p.method == "skinning"
        )
        assert point.time == pytest.approx(0.1 + shift) and point.time_spread == pytest.approx(0.05)
        assert run_time(scene) == ("cost/whole" if shift else "cost/frame")
        assert list(error_of_page_one(run))


@pytest.fixture(scope="module")
def drawings() -> list[Drawing]:
    run = run_of(all_rows())
    return [drawing for figure in FIGURES for drawing in figure(run)]


def test_a_caption_speaks_of_a_grey_band_only_where_one_is_seen():
    unknown = [r for r in all_rows() if not r.method.startswith("simulation-") and r.metric != "gap/refrozen"]
    tiny = [*unknown, row(SCENES[0], "simulation", "gap/refrozen", 1e-9, "J")]  # below the panel
    for rows, grey in ((all_rows(), True), (unknown, False), (tiny, False)):
        (drawing,) = error_of_page_one(run_of(rows))
        assert ("Grey: within the reference's uncertainty." in drawing.caption) == grey


def test_no_axis_is_labelled_in_markup(drawings):
    """Names may hold dollars, so that no text is taken for a formula: neither are an axis's numbers."""
    assert len(drawings) == 2
    for canvas in (drawing.canvas for drawing in drawings):
        FigureCanvasAgg(canvas).draw()
        labels = [
            label.get_text()
            for axes in canvas.axes
            for label in (*axes.get_xticklabels(), *axes.get_yticklabels())
        ]
        assert any(labels) and not [label for label in labels if "$" in label]
