"""Pictures of garments: what is rendered, in which colours, at which frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reports import rendering
from reports.pictures import SceneRollOuts, draw_side_by_side, failures, worst_failures
from tests.reports.report_folder import FRAMES, Stored, mesh, row, run_of, sheet


def scene_of(methods, height=0.1):
    cloth, faces = sheet(height)
    inertia = {"energy/inertia": np.array([0.0, 0.0, 1.0, 5.0, 2.0])}
    series = {
        method: mesh(cloth[:frames], faces, {name: values[:frames] for name, values in inertia.items()})
        for method, frames in methods.items()
    }
    return SceneRollOuts("tshirt/a", series, mesh(*sheet(0.0), {}))


def test_what_ended_early_moves_nobody_elses_picture():
    shown = scene_of({"simulation": FRAMES, "snug": FRAMES, "lbfgs-5": 2})
    run = run_of([row(method=method) for method in shown.series])
    drawing = draw_side_by_side(run, shown, ["simulation", "snug"])
    assert "frame 3 " in drawing.caption
    assert drawing.caption.endswith("want of room: L-BFGS, 5 iterations.")


def test_a_view_shows_the_nearer_surface_and_what_lies_behind_around_it():
    cloth, faces = sheet(0.1)
    camera = rendering.camera_for([cloth[0]], 0.0, 1.0)
    body = rendering.Surface(cloth[0] * [1.0, 1.0, 0.0], faces, (0.0, 0.0, 1.0))
    front = rendering.Surface(cloth[0], faces, (1.0, 0.0, 0.0))
    image, other = rendering.views(
        body, [front, rendering.Surface(cloth[0] - [0, 0, 0.2], faces, (0, 1, 0))], camera, 60, 60
    )
    assert image.shape == (60, 60, 3) and image[0, 0].min() == 1.0  # white around
    assert image[30, 30, 0] > 0.3 > image[30, 30, 2] and other[30, 30, 2] > 0.3 > other[30, 30, 1]
    # A corner of the mesh comes to where the camera says that it is.
    x, y, _ = camera.seen(cloth[0])[0]
    column, line = int(30 + 60 * x / camera.height), int(30 - 60 * y / camera.height)
    assert image[line - 2, column + 2].max() < 1.0 or image[line - 2, column + 2, 2] < 0.9


def test_a_failure_is_shown_at_its_worst_frame():
    rows = [row("tshirt/a", m, "energy/strain", v) for m, v in (("simulation", 0.1), ("snug", 2.0))]
    run = run_of(rows)
    cloth, faces = sheet(0.1)
    strain = {"energy/strain": np.array([0.0, 9.0, 1.0, 1.0, 1.0])}
    assert list(failures(run)) == []
    stored = replace(run, roll_outs=Stored(stored=mesh(cloth, faces, strain)))
    (drawing,) = failures(stored)
    assert drawing.name == "failures" and worst_failures(stored)[0].frame == 1
