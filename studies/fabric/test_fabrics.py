"""Fabrics, their specimens, scenes, known answers and tables: closed forms, properties, a user's files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import textile_scenes
import textile_tables
from benchmarks import DeclarationError, RollOut
from benchmarks.methods import find_method
from benchmarks.metric import SceneRollOuts
from benchmarks.plan.plan import make_plan
from benchmarks.plan.study import read_study
from benchmarks.presets import find_preset
from benchmarks.validation.clamped_strip import exact_elastica
from fabrics import (
    Fabric,
    find_fabric,
    isotropic,
    read_fabrics,
    read_gauge,
    spread_sample,
    users_fabrics,
)
from reference_sim import Trajectory, simulate
from reference_sim.geometry.topology import boundary_loops
from rest_shapes import drape, percentile
from specimens import (
    BENDING_LENGTH,
    DRAPE,
    PLATE,
    SPECIMEN,
    bending_length,
    cantilever,
    disc,
    ring,
    shadow,
)

HERE = Path(__file__).parent
PUBLISHED = HERE.parents[1] / "reports" / "published" / "fabric" / "results.csv.gz"
SNUG = find_fabric("snug")
TINY = replace(find_preset("smoke"), sheet_cells=6, sheet_frames=12)


# --- specimens ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [0.05, 2.0, 8.0, 30.0, 700.0])
def test_the_bending_length_is_that_of_the_shape(gamma):
    x, drop = exact_elastica(gamma, 0.0)[1]
    length = bending_length(0.3, float(np.arctan2(drop[-1], x[-1])))
    assert length == pytest.approx(0.3 / gamma ** (1 / 3), rel=1e-3)


def test_the_strip_has_the_fabrics_stiffness_and_overhangs_by_twice_its_bending_length():
    strip = cantilever(SNUG, 16)
    assert strip.stiffness == pytest.approx(SNUG.rigidity, rel=1e-6)
    assert strip.length == pytest.approx(2 * SNUG.bending_length, rel=1e-6)
    assert 0 < strip.clamp < strip.cell / 2
    # On the elastica it reads off its own bending length.
    s, (x, drop) = exact_elastica(8.0, 0.0)
    bent = strip.cloth.rest_positions.copy()
    along = (bent[:, 0] - strip.clamp) / strip.length
    bent[:, 0] = strip.clamp + strip.length * np.interp(along, s, x)
    bent[:, 1] = -strip.length * np.interp(along, s, drop)
    assert strip.measure(bent)[BENDING_LENGTH] == pytest.approx(1e3 * SNUG.bending_length, rel=1e-3)
    assert strip.error(bent) < 0.1 < strip.error(strip.start)


def test_the_ring_is_closed_equilateral_and_looks_up():
    points, faces, pins = ring(5)
    corners = points[faces]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    assert (edges.max(axis=1) / edges.min(axis=1)).max() < 1.12  # conformal: equilateral but for size
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 1] > 0).all()
    assert sorted(map(len, boundary_loops(faces))) == [len(pins) // 2] * 2
    radius = np.linalg.norm(points, axis=1)
    assert np.isclose(radius.max(), SPECIMEN)
    assert np.isclose(np.prod(np.unique(radius[pins].round(9))), PLATE**2)


def test_a_flat_disc_has_a_drape_coefficient_of_100_and_one_that_hangs_of_0():
    specimen = disc(SNUG, 8)
    flat = specimen.cloth.rest_positions
    assert specimen.measure(flat)[DRAPE] == pytest.approx(100.0, abs=0.4)  # chords of the border
    hanging = flat.copy()
    radius = np.linalg.norm(flat, axis=1)
    hanging[:, 1] = -np.maximum(radius - PLATE, 0)
    hanging[:, [0, 2]] *= np.minimum(PLATE / radius, 1.0)[:, None]
    assert specimen.measure(hanging)[DRAPE] == pytest.approx(0.0, abs=0.4)
    assert specimen.error(flat) is None


def test_layers_of_a_shadow_count_once():
    square = np.array([[-0.12, 0, -0.12], [0.12, 0, -0.12], [0.12, 0, 0.12], [-0.12, 0, 0.12]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    twice = (
        np.concatenate([square, square + np.array([0, 0.01, 0])]),
        np.concatenate([faces, faces[:, ::-1] + 4]),
    )
    assert shadow(square, faces) == pytest.approx(0.24**2, rel=2e-3) == shadow(*twice)


def test_overall_rigidity_is_the_geometric_mean():
    fabric = Fabric("twill", 0.2, 4e-5, 1e-5)
    assert fabric.rigidity == pytest.approx(2e-5)
    assert isotropic("plain", 0.2, 0.02).bending_length == pytest.approx(0.02)


# --- files of a user ---------------------------------------------------------------------------------------

TABLE = (
    "name, density[g/m2], bending warp[uN.m], bending weft[uN.m]\n"
    "voile, 62, 2.1, 1.4\n"
    "twill 2/1, 250,30,12\n"
)
GAUGE = {
    "satin": {"density": 0.07, "bend stiffness": 1.5e-6},
    "oxford": {"density": 0.2, "bend stiffness": 4.8e-5},
}


def test_a_file_is_read_in_si_and_by_its_heads(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text(TABLE)
    voile, twill = read_fabrics(path)
    assert voile == Fabric("voile", pytest.approx(0.062), pytest.approx(2.1e-6), pytest.approx(1.4e-6))
    assert twill.name == "twill_2_1"
    spreadsheet = TABLE.replace(",", ";").replace("2.1; 1.4", "2,1; 1,4").replace("twill 2/1", "voile")
    path.write_text(f"\ufeff{spreadsheet}; ;;\n")
    assert read_fabrics(path) == (voile, replace(twill, name="voile_2"))
    path.write_text("linear weft[SI*1e9], density[kg.m-2], linear warp[SI*1e9]\n1400, 0.062, 2100\n")
    (unnamed,) = read_fabrics(path)
    assert unnamed.name == "line_2" and unnamed.bending_length == pytest.approx(voile.bending_length)
    assert spread_sample((voile, twill)) == (voile, twill)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "line 1 has no column for density, warp, weft"),
        ("name,density[g/m2],bending warp[uN.m]\n", "no column for weft"),
        (TABLE.split("\n")[0], "holds no fabric"),
        (TABLE.replace("2.1", "soft"), "line 2: warp 'soft' is no number"),
        (TABLE.replace("62", "62000"), "line 2: density 62 in SI units"),
        (TABLE.replace("2.1", "nan"), "line 2: warp nan"),
        (
            "density[g/m2],bending warp[uN.m],bending weft[uN.m],name\n62,2.1,1.4",
            "line 2: has 3 cells",
        ),
        (TABLE.replace("2.1, 1.4", "2,1, 1,4"), "line 2: has 6 cells for 4"),
        (TABLE.replace(",", ";").replace("2.1; 1.4", "2,1; 1.400"), "line 2: weft '1,400' is no number"),
        (TABLE.replace("name", "density[kg.m-2]", 1), "line 1 has two columns for density"),
    ],
)
def test_a_bad_file_is_refused_with_its_line(tmp_path, text, complaint):
    path = tmp_path / "measured.csv"
    path.write_text(text)
    with pytest.raises(DeclarationError, match=f"{path}.*{complaint}"):
        read_fabrics(path)


def gauge_at(folder, text):
    path = folder / "GAUGE-Dataset/metadata/textile/textile bending.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return folder / "GAUGE-Dataset"


def test_fabrics_beside_the_study_are_tested(tmp_path):
    assert users_fabrics(tmp_path) == ()
    (tmp_path / "measured.csv").write_text(TABLE)
    gauge_at(tmp_path, json.dumps({"assets": {"textile": {"material": GAUGE}}}))
    names = {"measured/voile", "measured/twill_2_1", "gauge/satin", "gauge/oxford"}
    fabrics = {fabric.name: fabric for fabric in users_fabrics(tmp_path)}
    assert fabrics.keys() == names
    assert fabrics["gauge/satin"] == Fabric("gauge/satin", 0.07, 1.5e-6, 1.5e-6)
    assert percentile(2.0, [1.0, 3.0, 2.0, 0.5]) == 62.5


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[", "not the metadata .*: download it again"),
        ("[]", "TypeError"),
        ('{"bend stiffness": 1}', "KeyError: 'density'"),
        ('{"density": "soft", "bend stiffness": 1}', "ValueError"),
        ('{"density": 71, "bend stiffness": 1}', "density 71 in"),
    ],
)
def test_metadata_of_gauge_that_cannot_be_used_is_refused(tmp_path, text, complaint):
    text = f'{{"assets": {{"textile": {{"material": {{"satin": {text}}}}}}}}}'
    with pytest.raises(DeclarationError, match=complaint):
        read_gauge(gauge_at(tmp_path, text))


# --- scenes and metrics ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    return make_plan(read_study(str(HERE)), folder=tmp_path_factory.mktemp("fabric"))


def test_the_study_asks_for_what_was_published(plan):
    rows = pd.read_csv(PUBLISHED, low_memory=False)
    cells = {(cell.scene.name, cell.method) for cell in plan.cells}
    cells |= {(case.name, case.method) for case in plan.cases}
    ran = rows[rows["status"] != "skipped"]
    assert set(zip(ran["scene"], ran["method"])) == cells
    assert {case.suite for case in plan.cases} == {"fabric"}


def built_scene(test):
    (scene,) = (s for s in textile_scenes.SCENES if s.name == f"fabric/{test}/snug")
    return textile_scenes.build(scene, **scene.at(TINY).options)


@pytest.fixture(scope="module")
def hanging():
    built = built_scene("cantilever")
    moved = simulate(built.cloth, built.energies, dt=built.dt, frames=built.frames, start=built.start)
    return built, moved


def test_the_reference_reads_off_the_bending_length(hanging):
    built, moved = hanging
    values = textile_scenes.measure(RollOut(SceneRollOuts(built), find_method("simulation"), moved))
    assert values["fabric/error"] < 3.0 and 16.5 < values["fabric/bending_length"] < 17.8


def test_a_roll_out_that_ended_early_has_no_reading(hanging):
    built, moved = hanging
    short = replace(moved, positions=moved.positions[:5], times=moved.times[:5],
                    frame_seconds=moved.frame_seconds[:5], frame_fields={})  # fmt: skip
    assert textile_scenes.measure(RollOut(SceneRollOuts(built), find_method("vbd-5"), short)) == {}


def test_a_drape_is_compared_with_the_references():
    built = built_scene("drape")
    group = SceneRollOuts(built)

    def roll_out(scale):
        frames = np.repeat((built.start * [scale, 1.0, scale])[None], built.frames, axis=0)
        result = Trajectory(frames, built.cloth.faces, built.dt * np.arange(built.frames))
        return RollOut(group, find_method("simulation"), result)

    assert "fabric/error" not in textile_scenes.measure(roll_out(1.0))
    flat, shrunk = roll_out(1.0), roll_out(0.9)
    expected = (0.15**2 - 0.135**2) / (0.15**2 - 0.09**2)
    assert textile_scenes.compare(shrunk, flat)["fabric/error"] == pytest.approx(100 * expected, rel=0.03)
    assert textile_scenes.compare(flat, flat)["fabric/error"] == 0.0


# --- known answers -----------------------------------------------------------------------------------------

QUICK = ("master_curve_1_80", "master_curve_100_80", "master_curve_1000_160", "astm_d1388_angle",
         "bending_length_14_cells_30_steps", "bend_twist_arc_3", "bend_twist_leaves_plane_3",
         "bend_twist_curl_3_10", "stick_slip_ratio_0.1", "stick_slip_breaks_loose_0.1")  # fmt: skip


@pytest.mark.parametrize("name", QUICK)
def test_a_known_answer_is_found(name, plan):
    (case,) = (case for case in plan.cases if case.name == name)
    row = case.run()
    assert row.status == "ok", row.reason


@pytest.mark.slow
def test_every_known_answer_is_that_of_the_published_run(plan):
    published = pd.read_csv(PUBLISHED, low_memory=False).query("metric == 'check'").set_index("scene")
    for case in plan.cases:
        row = case.run()
        assert row.status == "ok", row.reason
        assert row.value == pytest.approx(published["value"][case.name], rel=0.05, abs=1e-4)


def test_a_coarse_disc_drapes_more_the_limper_it_is():
    assert 40.0 < drape("snug", rings=3) < 65.0 and 80.0 < drape("thick_stiff", rings=3) < 95.0


# --- tables ------------------------------------------------------------------------------------------------


def test_tables_of_the_published_run_are_the_frozen_ones_and_stand_in_the_readme():
    readme = (HERE / "README.md").read_text(encoding="utf-8")
    for name, table in textile_tables.tables(pd.read_csv(PUBLISHED, low_memory=False)).items():
        frozen = pd.read_csv(HERE / "frozen" / f"{name}.csv", na_values="-")
        key = frozen.columns[0]
        frozen = frozen.set_index(key).loc[table[key], list(table.columns[1:])].reset_index()
        pd.testing.assert_frame_equal(table.astype(frozen.dtypes), frozen, rtol=1e-8)
        assert textile_tables.markdown(table) in readme
