"""Suite fabric: its scenes, its metrics, its cases, and how a user's fabrics enter it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.methods.catalogue.all_methods import METHODS, find_method
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics.surface import textile_tests as metrics
from benchmarks.plan.study import StudyError
from benchmarks.presets import find_preset
from benchmarks.scenes.textile_tests import TEXTILE_TESTS
from benchmarks.validation.fabric.cases import DRAPE
from benchmarks.validation.fabric.cases import TEXTILE_TESTS as CASES
from reference_sim import simulate
from reference_sim.trajectory import Trajectory
from tests.benchmarks.fabrics.gauge_folder import make_folder
from tests.benchmarks.plan.planned import planned

TINY = replace(find_preset("smoke"), sheet_cells=6, sheet_frames=12)
TABLE = "name,density[g/m2],bending warp[uN.m],bending weft[uN.m]\nvoile,62,2.1,1.4\n"


def test_every_solver_stopped_early_meets_every_fabric():
    plan = planned("fabric")
    stopped = {entry.name for entry in METHODS if entry.role == "solver"}
    assert len(stopped) > 10
    for scene in TEXTILE_TESTS:
        assert stopped < {cell.method for cell in plan.cells if cell.scene.name == scene.name}
    assert {case.suite for case in plan.cases} == {"fabric"}


def test_a_users_fabrics_are_tested_and_snug_is_placed_among_them(tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text(TABLE)
    plan = planned("fabric", "--set", f"fabrics={path}")
    assert {"fabric/drape/measured/voile", "fabric/cantilever/measured/voile"} < {s.name for s in plan.scenes}
    assert {"percentile_snug", "percentile_snug_printed"} < {case.name for case in plan.cases}
    with pytest.raises(StudyError, match="only study fabric tests fabrics"):
        planned("--set", f"fabrics={path}")


def test_a_copy_of_gauge_brings_its_fabrics(tmp_path):
    folder = str(make_folder(tmp_path))
    plan = planned("fabric", "--set", f"gauge={folder}")
    assert {"fabric/drape/gauge/satin", "fabric/cantilever/gauge/oxford"} < {s.name for s in plan.scenes}
    methods = {cell.method for cell in plan.cells if cell.scene.name == "fabric/cantilever/gauge/satin"}
    assert {"simulation", *(entry.name for entry in METHODS if entry.role == "solver")} < methods
    alone = planned("fabric", "--set", f"gauge={folder}", "--scenes", "fabric/*/gauge/satin")
    assert len(alone.scenes) == 2 and not alone.cases
    with pytest.raises(StudyError, match=r"gauge=.*: only study fabric"):
        planned("--set", f"gauge={folder}")


@pytest.fixture(scope="module")
def cantilever():
    built = next(s for s in TEXTILE_TESTS if s.name == "fabric/cantilever/snug").at(TINY).build()
    moved = simulate(built.cloth, built.energies, dt=built.dt, frames=built.frames, start=built.start)
    return built, moved


def test_the_reference_reads_off_the_bending_length(cantilever):
    built, moved = cantilever
    values = metrics.measure(RollOut(SceneRollOuts(built), find_method("simulation"), moved))
    assert values["fabric/error"] < 3.0 and 16.5 < values["fabric/bending_length"] < 17.8


def test_a_roll_out_that_ended_early_has_no_reading(cantilever):
    built, moved = cantilever
    short = replace(moved, positions=moved.positions[:5], times=moved.times[:5],
                    frame_seconds=moved.frame_seconds[:5], frame_fields={})  # fmt: skip
    assert metrics.measure(RollOut(SceneRollOuts(built), find_method("vbd-5"), short)) == {}


def test_a_drape_is_compared_with_the_references():
    built = next(s for s in TEXTILE_TESTS if s.name == "fabric/drape/snug").at(TINY).build()
    group = SceneRollOuts(built)

    def roll_out(scale):
        x = built.start * [scale, 1.0, scale]
        frames = np.repeat(x[None], built.frames, axis=0)
        made = Trajectory(
            positions=frames, faces=built.cloth.faces, times=built.dt * np.arange(built.frames),
            frame_seconds=np.zeros(built.frames), status="ok", reason="", provenance={}, frame_fields={},
        )  # fmt: skip
        return RollOut(group, find_method("simulation"), made)

    assert "fabric/error" not in metrics.measure(roll_out(1.0))
    flat, shrunk = roll_out(1.0), roll_out(0.9)
    expected = (0.15**2 - 0.135**2) / (0.15**2 - 0.09**2)
    assert metrics.compare(shrunk, flat)["fabric/error"] == pytest.approx(100 * expected, rel=0.03)
    assert metrics.compare(flat, flat)["fabric/error"] == 0.0


QUICK = ("master_curve_1_80", "master_curve_100_80", "master_curve_1000_160", "astm_d1388_angle",
         "bending_length_14_cells_30_steps", "bend_twist_arc_3", "bend_twist_leaves_plane_3",
         "bend_twist_curl_3_10", "stick_slip_ratio_0.1", "stick_slip_breaks_loose_0.1")  # fmt: skip


@pytest.mark.parametrize("case", [case for case in CASES if case.name in QUICK], ids=lambda case: case.name)
def test_a_case_is_found(case):
    row = case.run()
    assert row.status == "ok" and row.suite == "fabric", row.reason


def test_a_coarse_disc_drapes_more_the_limper_it_is():
    coarse = {case.name: replace(case, options=case.options | {"rings": 3}) for case in DRAPE}
    limp, stiff = (coarse[f"drape_{name}_5_rings_30_steps"].run().value for name in ("snug", "thick_stiff"))
    assert 40.0 < limp < 65.0 and 80.0 < stiff < 95.0


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_case_is_found(case):
    row = case.run()
    assert row.status == "ok", row.reason
    assert case.expected is None or case.tolerance is None or abs(row.value - row.expected) <= case.tolerance
