"""Pictures of garments: what is rendered, in which colours, at which frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reports import rendering
from reports.blocks import FIGURES
from reports.finished_run import read_run
from reports.pictures import SceneRollOuts, draw_side_by_side, failures, worst_failures
from tests.reports.report_folder import FRAMES, Stored, mesh, row, run_folder, run_of, sheet


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


def test_light_from_the_side_tells_a_fold_from_a_sheet():
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 61), np.linspace(1.0, 1.4, 41))
    corner = (np.arange(40)[:, None] * 61 + np.arange(60)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 62], 1), np.stack([corner, corner + 62, corner + 61], 1)]
    )

    def shades(depth: float) -> float:
        points = np.stack([x.ravel(), y.ravel(), depth * np.sin(40.0 * x.ravel())], axis=1)
        camera = rendering.camera_for([points], 0.0, 0.7)
        (image,) = rendering.views(
            None, [rendering.Surface(points, faces, rendering.CLOTH_COLOUR)], camera, 90, 63
        )
        return float(image[20:43, 20:70].mean(axis=2).std())

    assert shades(0.01) > 0.04 > 5.0 * shades(0.0)


def test_a_failure_is_shown_at_its_worst_frame():
    rows = [row("tshirt/a", m, "energy/strain", v) for m, v in (("simulation", 0.1), ("snug", 2.0))]
    run = run_of(rows)
    cloth, faces = sheet(0.1)
    strain = {"energy/strain": np.array([0.0, 9.0, 1.0, 1.0, 1.0])}
    assert list(failures(run)) == []
    stored = replace(run, roll_outs=Stored(stored=mesh(cloth, faces, strain)))
    (drawing,) = failures(stored)
    assert drawing.name == "failures" and worst_failures(stored)[0].frame == 1


def test_only_what_was_drawn_is_read(tmp_path):
    """A scene of another kind, such as a roll-out of a thousand frames, has no pictures of its frames."""
    folder = run_folder(tmp_path, [row("tshirt/there_and_back", metric="roll_out/drift", unit="mm")])
    path = folder.trajectory_path("tshirt/there_and_back", "snug")
    path.parent.mkdir(parents=True)
    path.write_bytes(b"no mesh")
    run = read_run(folder)
    assert [drawing for figure in FIGURES for drawing in figure.drawings(run)] == [] and run.problems == []
