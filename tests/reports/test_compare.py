"""Two runs compared: noise is no change, a planted one is found, and the exit status says which."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.results.row import ResultsError
from reports import compare as command
from reports.comparison import compare
from tests.reports.report_folder import row, run_folder, run_of

SCENES = ("tshirt/walk", "tshirt/jump", "tshirt/bow", "tshirt/kick")
SEEDS = (0, 1, 2)


def rows_of(draw: int = 0, **factors: float):
    """A network whose seeds scatter by 3 %, a simulation, a solver with a time, a check."""
    scatter = np.random.default_rng(draw).normal(1.0, 0.03, (len(SCENES), len(SEEDS)))
    factor = {"snug": 1.0, "lbfgs-5": 1.0, "time": 1.0, **factors}
    rows = []
    for i, scene in enumerate(SCENES):
        rows.append(row(scene, "simulation", "energy/strain", 1.0 + i))
        rows.append(
            row(scene, "lbfgs-5", "energy/strain", factor["lbfgs-5"] * (1.3 + i), uncertainty=0.01)
        )
        rows.append(row(scene, "lbfgs-5", "curvature/mean", 5.0 + i, unit="1/m"))
        rows += [
            row(scene, "snug", "energy/strain", factor["snug"] * (2.0 + i) * scatter[i, seed], seed=seed)
            for seed in SEEDS
        ]
    timed = {"suite": "speed", "method": "lbfgs-5"}
    rows.append(row("flag", metric="cost/frame", unit="ms", value=10.0 * factor["time"], **timed))
    rows.append(row("flag", metric="cost/spread", unit="%", value=4.0, **timed))
    rows.append(
        row("flag", metric="cost/frame_worst", unit="ms", value=20.0 * factor["time"] ** 3, **timed)
    )
    check = {"suite": "validation", "method": "simulation", "metric": "check", "unit": "m"}
    return [*rows, row("sag", value=0.28, expected=0.28, tolerance=1e-3, **check)]


def found(one, other, **options):
    return [
        (c.verdict, c.place, c.method, c.metric)
        for c in compare(run_of(one), run_of(other), **options).changes
    ]


def test_a_network_that_is_better_beyond_its_seeds_is_found():
    assert found(rows_of(), rows_of(1, snug=0.7)) == [("better", "tshirt", "snug", "energy/strain")]


def test_what_the_uncertainty_or_2_percent_covers_is_no_change():
    worse = rows_of(**{"lbfgs-5": 1.1})
    assert found(rows_of(), worse) == [("worse", "tshirt", "lbfgs-5", "energy/strain")]
    assert found(rows_of(), rows_of(**{"lbfgs-5": 1.015})) == []
    unsure = [dataclasses.replace(r, uncertainty=0.5 * (r.method == "lbfgs-5")) for r in worse]
    assert found(rows_of(), unsure) == []


def test_cells_of_two_protocols_are_refused():
    """A cell beside another reference is a user's own, though other rows of its run are of one protocol."""
    own = [
        dataclasses.replace(r, protocol="own" if r.scene == "tshirt/bow" else "1.0") for r in rows_of()
    ]
    frozen = [dataclasses.replace(r, protocol="1.0") for r in rows_of()]
    with pytest.raises(ResultsError, match=r"tshirt/bow x simulation: of protocol 1\.0 in A, own in B"):
        compare(run_of(frozen), run_of(own))


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ({"preset": "quick"}, {"preset": "smoke"}, "preset quick in A"),
        ({"preset_values": {"frames": 20}}, {"preset_values": {"frames": 60}}, "frames 20 in A, 60 in B"),
        ({"body": ["a.npz", "1"]}, {"body": ["b.npz", "2"]}, r"body \['a.npz', '1'\] in A"),
        ({"preset_values": {"steps": {"snug": 1}}}, {"preset_values": {"steps": {"snug": 2}}}, None),
        ({"preset_values": {"frames": 20}}, {"preset_values": {"frames": 20, "new": 1}}, None),
    ],
)
def test_runs_of_other_scenes_are_refused_by_name(before, after, says):
    one, other = run_of(rows_of(), **before), run_of(rows_of(), **after)
    if says is None:
        assert compare(one, other).changes == ()
        return
    with pytest.raises(ResultsError, match=says):
        compare(one, other)


def test_where_zero_is_a_choice_no_change_hangs_on_it():
    """All gravity energies are higher by 50 J, or by none: the same change is found in both."""

    def heights(more: float, zero: float):
        rows = [row(s, "simulation", "energy/gravity", zero + 1.0 + i) for i, s in enumerate(SCENES)]
        rows += [row(s, "skinning", "energy/gravity", zero + 2.0 + i) for i, s in enumerate(SCENES)]
        rows += [dataclasses.replace(r, metric="energy/total") for r in rows]
        return rows + [
            row(s, "lbfgs-5", "energy/gravity", zero + 1.1 + i + more) for i, s in enumerate(SCENES)
        ]

    # Patterns leave out simulation and skinning, or the total energy: the excess is of them all the same.
    moved = [("worse", "tshirt", "lbfgs-5", "relative_excess/gravity")]
    for zero, options in (
        (0.0, {}),
        (50.0, {"methods": "lbfgs-*"}),
        (50.0, {"metrics": "energy/gravity"}),
    ):
        assert found(heights(0.0, zero), heights(0.03, zero), **options) == moved
    assert found(heights(0.0, 50.0), heights(0.015, 50.0)) == []  # 1.5 % of skinning's excess


def test_repeated_times_count_beyond_15_percent_on_one_machine():
    assert found(rows_of(), rows_of(time=1.15)) == []
    assert found(rows_of(), rows_of(time=1.25)) == [("worse", "flag", "lbfgs-5", "cost/frame")]
    assert found(rows_of(), rows_of(time=1.5), times=False) == []
    elsewhere = [dataclasses.replace(r, hardware="another") for r in rows_of(time=1.5)]
    assert found(rows_of(), elsewhere) == []


def test_a_cell_that_fails_and_a_check_that_is_off_are_worse():
    def ended(r):
        if r.scene == "sag":
            return dataclasses.replace(r, status="failed", value=0.5, reason="off")
        lost = r.method == "snug" and r.scene == SCENES[0] and r.seed == 1
        return dataclasses.replace(r, status="diverged", value=None, reason="step 7") if lost else r

    later = [ended(r) for r in rows_of()]
    both = [("worse", SCENES[0], "snug", "energy/strain"), ("worse", "sag", "simulation", "check")]
    assert found(rows_of(), later) == found(rows_of(), later, metrics="curvature/*") == both
    assert [verdict for verdict, *_ in found(later, rows_of())] == ["better", "better"]
    assert found(rows_of(), later, methods="lbfgs-*") == []


def test_exit_status_and_lines(tmp_path, capsys):
    run_folder(tmp_path / "a", rows_of())
    run_folder(tmp_path / "b", rows_of(1, snug=1.3))
    one, worse = str(tmp_path / "a"), str(tmp_path / "b")
    assert command.main([one, one]) == 0 and "0 worse" in capsys.readouterr().out
    assert command.main([one, worse]) == 1
    line = capsys.readouterr().out.splitlines()[0]
    assert line.startswith("worse   tshirt  snug  energy/strain  3.5")
    assert " J, × 1.3" in line and "p " in line
    assert command.main([worse, one]) == 0


@pytest.mark.parametrize("b, options", [("none", []), ("a", ["--metrics", "energy/strian"])])
def test_bad_input_is_one_line_and_status_2(tmp_path, refused, b, options):
    run_folder(tmp_path / "a", rows_of())
    refused("reports.compare: ", command.main, [str(tmp_path / "a"), str(tmp_path / b), *options])
