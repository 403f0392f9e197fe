"""Room in figures of many methods: panels stay large, and no text covers another, a panel or a legend."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from reports.blocks import FIGURES
from reports.figures.plotting import PAGE_WIDTH, Drawing
from reports.finished_run import Run
from tests.reports.report_folder import row, run_of

LEAST = 4.0  # [cm] that a panel is wide and high on paper
PRINTED = 17.0 / 2.54 / PAGE_WIDTH  # inches on paper of an inch of a figure as wide as the page
LETTERS = 1.0  # [points] by which boxes of texts may overlap: letters do not fill them
ROLES = {
    "simulation": "reference", "skinning": "baseline", "nearest-poses": "baseline",
    "pose-regression": "baseline", **dict.fromkeys(
        ("snug", "supervised", "pbns", "ncs", "handles-20", "handles-40", "handles-80", "snug+cleanup",
         "snug-springs", "tailornet", "santesteban2019"), "network"),
}  # fmt: skip
LABELS = {
    "skinning": "Skinning alone", "nearest-poses": "Nearest poses",
    "pose-regression": "Ridge on principal components", "ncs": "Neural Cloth Simulation, static branch",
    "snug+cleanup": "SNUG, post-processed", "snug-springs": "SNUG, springs in place of the membrane",
    "tailornet": "TailorNet, a network for each frequency",
}  # fmt: skip
SCENES = ("tshirt/01_01_a", "tshirt/push_recovery", "tshirt/sit_and_stand", "tshirt/cartwheel_lean")
FRAMES = 40


def rows_of_all():
    """Rows of every suite that a figure shows."""
    rows, rng = [], np.random.default_rng(0)
    for scene, (place, (method, role)) in itertools.product(SCENES, enumerate(ROLES.items())):
        more = {"role": role, "family": "handles" if "handles" in method else method, "seeded": False}
        more |= {"level": float(method[-2:])} if "handles" in method else {}
        spread = 10.0 ** rng.uniform(-1.0, 1.0)
        values = {
            "energy/total": 1.0 + place, "energy/strain": 0.1 + place, "penetration/vertices": 0.1 * place,
            "curvature/error": 4.0 * spread, "cost/frame": 0.1 * 1.5**place if place else 100.0,
            "gap/energy": 0.1 * spread, "step/distance": 3.0 * spread, "distance/rms": 10.0 * spread,
            "cost/train": 300.0 + place, "cost/data": 0.0,
        }  # fmt: skip
        for suite in ("garments", "speed"):
            rows += [row(scene, method, name, x, suite=suite, **more) for name, x in values.items()]
    for scene, k in itertools.product(SCENES, range(1, 9)):
        more = {"suite": "speed", "role": "solver", "family": "newton", "level": k}
        for name, x in {"cost/frame": 9.0 * k, "gap/energy": 0.3 / k**3, "curvature/error": 5.0 / k}.items():
            rows.append(row(scene, f"newton-{k}", name, x, **more))
    return rows


@pytest.fixture(scope="module")
def run() -> Run:
    labels = {name: {"label": LABELS.get(name, name.replace("-", " ").capitalize())} for name in ROLES}
    run = run_of(rows_of_all(), methods=labels)
    lines = [
        (SCENES[0], method, 0, k / 30, *(0.01 * (2 + place + np.sin(k / 5 + place)) for _ in range(3)))
        for place, method in enumerate(ROLES)
        for k in range(FRAMES)
    ]
    columns = ["scene", "method", "seed", "seconds", "strain", "bending", "inertia"]
    energies = pd.DataFrame(lines, columns=columns)
    return replace(run, frame_energies=energies)


@pytest.fixture(scope="module")
def drawings(run) -> list[Drawing]:
    return [drawing for figure in FIGURES for drawing in figure.drawings(run)]


def test_panels_of_fifteen_methods_are_at_least_four_centimetres_wide_and_high(drawings):
    assert len(ROLES) == 15 and len(drawings) == 2
    for drawing in drawings:
        FigureCanvasAgg(drawing.canvas).draw()
        scale = 2.54 * min(PRINTED, 17.0 / 2.54 / drawing.canvas.get_figwidth()) / drawing.canvas.dpi
        for axes in drawing.canvas.axes:
            width, height = (scale * length for length in axes.get_window_extent().bounds[2:])
            assert min(width, height) >= LEAST, f"{drawing.name}: a panel of {width:.1f} x {height:.1f} cm"


def test_no_text_covers_another_or_a_panel_and_all_are_inside_the_figure(drawings):
    for drawing in drawings:
        canvas = drawing.canvas
        FigureCanvasAgg(canvas).draw()
        beside, written = texts(canvas)
        legends = [("legend", inner(legend)) for legend in canvas.legends]
        panels = [axes.get_window_extent() for axes in canvas.axes]
        outer = [(text.get_text(), inner(text)) for text in beside] + legends
        assert not [name for name, box in outer if any(map(box.fully_overlaps, panels))], drawing.name
        boxes = [*outer, *((text.get_text(), inner(text)) for text in written)]
        pairs = itertools.combinations(boxes, 2)
        covered = [(one[0], other[0]) for one, other in pairs if one[1].fully_overlaps(other[1])]
        assert not covered, drawing.name
        left, low, right, high = canvas.bbox.extents
        cut = [n for n, box in boxes if box.x0 < left or box.y0 < low or box.x1 > right or box.y1 > high]
        assert not cut, drawing.name


def inner(drawn: Text | Legend) -> Bbox:
    """Box of its letters [pixel]."""
    return drawn.get_window_extent().padded(-LETTERS * drawn.get_figure().dpi / 72.0)


def texts(canvas) -> tuple[list[Text], list[Text]]:
    """Texts that are seen: around panels, and in them."""
    around = list(canvas.texts)
    for axes in canvas.axes:
        around.append(axes.title)
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            around += [axis.label, *(tick.label1 for tick in ticks)]
    written = [text for axes in canvas.axes for text in axes.texts]
    return tuple([t for t in some if t.get_visible() and t.get_text().strip()] for some in (around, written))
