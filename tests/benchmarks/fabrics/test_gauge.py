"""GAUGE's files and observables, on a small folder of the same form."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from benchmarks.fabrics.fabric import Fabric
from benchmarks.fabrics.gauge import GaugeFileError, read_tasks, read_trial, trial_files, version
from benchmarks.fabrics.markers import deviations
from benchmarks.validation.fabric.cases import GAUGE_BASELINES, gauge_repeatability
from tests.benchmarks.fabrics.gauge_folder import FABRICS, HEIGHTS, SPACING, TILTS, grid, make_folder


@pytest.fixture
def folder(tmp_path):
    return make_folder(tmp_path / "GAUGE-Dataset")


def test_fabrics_and_markers_are_read_from_the_metadata(folder):
    stretching, bending = read_tasks(folder)
    assert (stretching.name, bending.name) == ("stretching", "bending")
    satin, oxford = (Fabric(name, density, k, k) for name, (density, k) in FABRICS.items())
    assert stretching.fabrics == (satin, oxford)
    assert stretching.markers.rest == pytest.approx(grid())
    # A corner lies in one or two faces; where two lines meet there is one angle, at their ends none.
    assert np.bincount(stretching.markers.angles[:, 0]).tolist()[:6] == [2, 3, 3, 1, 3, 6]
    assert bending.markers.angles[:, 0].tolist() == [2, 3, 4, 5]


def test_a_trial_is_read_in_metres_and_in_the_order_of_the_metadata(folder):
    stretching, _ = read_tasks(folder)
    files = trial_files(folder, "stretching", "satin")
    assert [path.name for path in files] == ["1.json", "2.json", "3.json"]
    x = read_trial(files[2], stretching)
    assert x.shape == (7, 16, 3) and x[0] == pytest.approx(grid())
    assert x[-1, 5] - x[0, 5] == pytest.approx([HEIGHTS[2], 0, 0])


def test_a_flat_sheet_has_no_curvature_wherever_it_is(folder):
    markers = read_tasks(folder)[0].markers
    turned = grid() @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0].T + 3.0
    assert markers.curvature(turned) == pytest.approx(0.0, abs=1e-12)


def test_the_curvature_of_a_cone_is_its_angle_deficit(folder):
    markers, x = read_tasks(folder)[0].markers, grid()
    x[5, 0] += 0.03
    flat, slant = x[[1, 4, 6, 9]] - x[5], np.hypot(SPACING, 0.03)
    assert np.linalg.norm(flat, axis=1) == pytest.approx(slant)
    corners = x[[0, 4, 8, 9, 10, 6, 2, 1]] - x[5]  # neighbours round the marker, some of no common face
    around = corners[[0, 1, 3, 4, 5, 7]]  # those of its six faces
    unit = around / np.linalg.norm(around, axis=1)[:, None]
    angles = np.arccos((unit * np.roll(unit, -1, axis=0)).sum(axis=1))
    k = markers.curvature(x)
    assert k[5] == pytest.approx(2 * np.pi - angles.sum()) and k[5] > 0.05
    # Gauss and Bonnet: a bump within a flat border adds nothing.
    assert markers.curvature(x).sum() == pytest.approx(0.0, abs=1e-9)


def test_a_line_s_curvature_is_the_angle_by_which_it_turns(folder):
    _, bending = read_tasks(folder)
    x = read_trial(trial_files(folder, "bending", "satin")[2], bending)
    k = bending.markers.curvature(x)
    assert k[-1, 2:6] == pytest.approx([0, 0, TILTS[2], TILTS[2]])
    assert k[:, [0, 1, 6, 7]] == pytest.approx(np.pi / 2)  # no angle there: constant


def test_the_deviation_of_trials_is_known(folder):
    tasks = read_tasks(folder)
    cases = {case.name: case for case in gauge_repeatability(folder, tasks)}
    assert list(cases) == [f"gauge_{what}_{task}_satin" for task in ("stretching", "bending")
                           for what in ("repeatability", "spread")]  # fmt: skip
    # Two lines turn by 0, 0.2 and 0.4 rad in half of the frames: their mean by 0.2.
    known = np.degrees([0.2, 0.0, 0.2]) * np.sqrt(2 * 0.5)
    row, spread = (cases[f"gauge_{what}_bending_satin"].run() for what in ("repeatability", "spread"))
    assert (row.value, spread.value) == (pytest.approx(known.mean()), pytest.approx(known.std()))
    assert (row.status, row.expected, spread.expected) == ("ok", *GAUGE_BASELINES["bending"])
    assert cases["gauge_repeatability_stretching_satin"].run().value > 0.0
    with pytest.raises(ValueError, match="at least two"):
        deviations([np.zeros((3, 2))])


def test_files_that_changed_since_the_plan_are_refused(folder):
    before = version(folder, "bending", "satin")
    case = next(c for c in gauge_repeatability(folder, read_tasks(folder)) if "bending" in c.name)
    path = trial_files(folder, "bending", "satin")[0]
    path.write_text(path.read_text() + " ")
    assert version(folder, "bending", "satin") != before
    assert "changed since" in case.run().reason


def test_a_folder_may_have_no_trials_but_not_elsewhere(folder):
    (folder / "data/textile").rename(folder / "data/cloth")
    with pytest.raises(GaugeFileError, match=r"no trial '.*stretching/json/satin/1\.json'"):
        gauge_repeatability(folder, read_tasks(folder))
    (folder / "data").rename(folder / "elsewhere")
    assert gauge_repeatability(folder, read_tasks(folder)) == ()


def altered(**more):
    return lambda content: content.update(more)


def set_in(*keys, to):
    def change(content):
        for key in keys[:-1]:
            content = content[key]
        content[keys[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (altered(FPS=180), "expected 'FPS' 30"),
        (set_in("translation unit", to="inch"), "of mm or m"),
        (lambda content: content["textile"].pop("marker-01"), "0 objects of 16 markers"),
        (set_in("textile", "marker-01", "x", to=[1.0]), "gaps or another length"),
        (set_in("textile", "marker-01", "x", 0, to=None), "no position in some frame"),
        (set_in("textile", "marker-01", "x", 0, to=900.0), "marker begins 400 mm from its place"),
    ],
)
def test_a_trial_that_cannot_be_used_is_refused(folder, change, complaint):
    task, path = read_tasks(folder)[0], trial_files(folder, "stretching", "satin")[0]
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(GaugeFileError, match=f"--gauge {re.escape(str(path))}: .*{complaint}"):
        read_trial(path, task)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda content: content.pop("markers"), "not the metadata of a textile task .KeyError: 'markers'"),
        (set_in("markers", "inner", to=[]), "neither inner, edge nor corner"),
        (set_in("markers", "faces", to=[[0, 1, 16]]), "names one more"),
        (set_in("assets", "textile", "material", "satin", "density", to=71.0), "density 71 is outside"),
        (set_in("assets", "textile", "material", "satin", "bend stiffness", to="soft"), "ValueError"),
    ],
)
def test_metadata_that_cannot_be_used_is_refused(folder, change, complaint):
    path = folder / "metadata/textile/textile stretching.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(GaugeFileError, match=f"--gauge {re.escape(str(path))}: .*{complaint}"):
        read_tasks(folder)


def test_another_folder_is_refused(tmp_path):
    with pytest.raises(GaugeFileError, match=r"textile bending\.json': give the folder"):
        read_tasks(tmp_path)
    path = tmp_path / "metadata/textile/textile bending.json"
    path.parent.mkdir(parents=True)
    path.write_text("[")
    with pytest.raises(GaugeFileError, match="cannot be read"):
        read_tasks(tmp_path)
