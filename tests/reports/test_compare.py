"""Two runs compared: noise is no change, a planted one is found, and the exit status says which."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.results.row import ResultsError, Row
from reports import compare as command
from reports.comparison import compare
from reports.scene_changes import FAILING, OTHER, WORSE
from tests.reports.report_folder import row, run_folder, run_of

SCENES = tuple(f"tshirt/motion_{k}" for k in range(8))
SEEDS = (0, 1, 2)
METRICS = {"energy/strain": 0.04, "curvature/error": 6.0, "penetration/vertices": 0.3}


def a_run(draw: int = 0) -> list[Row]:
    """A network whose seeds scatter by 5 % alike in all motions and 10 % in each, a simulation, a solver."""
    random = np.random.default_rng(draw)
    rows = []
    for metric, size in METRICS.items():
        alike = random.normal(0.0, 0.05, len(SEEDS))
        for k, scene in enumerate(SCENES):
            level = size * (1.0 + 0.3 * k)
            values = level * np.exp(alike + random.normal(0.0, 0.1, len(SEEDS)))
            rows += [row(scene, "snug", metric, float(values[s]), seed=s) for s in SEEDS]
            rows.append(row(scene, "simulation", metric, 0.5 * level, uncertainty=0.005 * level))
    for scene in SCENES:
        for method, time in (("simulation", 60.0), ("skinning", 0.2)):
            value = time * float(np.exp(random.normal(0.0, 0.05)))
            rows.append(row(scene, method, "cost/frame", value, unit="ms"))
    for method, time in (("simulation", 60.0), ("lbfgs-5", 6.0)):
        rows.append(row("flag", method, "cost/frame", time, suite="speed", unit="ms"))
        rows.append(row("flag", method, "cost/spread", 3.0, suite="speed", unit="%"))
        slowest = 7.0 * 100.0 ** (draw % 2)  # of each second run one frame is slow
        rows.append(row("flag", method, "cost/frame_worst", slowest, suite="speed", unit="ms"))
    # Of a scene without skinning, whose total is next to nothing.
    rows += [row("fall", m, "energy/total", 5e-8, suite="speed") for m in ("simulation", "lbfgs-5")]
    check = {"suite": "validation", "unit": "m", "expected": 0.28, "tolerance": 1e-3}
    return [*rows, row("sag", "simulation", "check", 0.28, **check)]


def times(factor: float, **where: object) -> Callable[[Row], Row]:
    def change(given: Row) -> Row:
        fits = all(getattr(given, name) == value for name, value in where.items())
        return replace(given, value=factor * given.value) if fits else given

    return change


STRAIN = {"method": "snug", "metric": "energy/strain"}
SIMULATED = {"method": "simulation", "metric": "energy/strain"}
TIME = {"method": "lbfgs-5", "metric": "cost/frame"}
PLANTED = {
    "strain three times on one of eight motions": times(3.0, scene=SCENES[0], **STRAIN),
    "strain ten times on one motion": times(10.0, scene=SCENES[5], **STRAIN),
    "strain 1.3 times on all motions": times(1.3, **STRAIN),
    "the simulation's strain 6 % more on one motion": times(1.06, scene=SCENES[3], **SIMULATED),
    "simulation five times as slow, timed once": times(
        5.0, method="simulation", metric="cost/frame", suite="garments"
    ),
    "skinning five times as slow, timed once": times(5.0, method="skinning", metric="cost/frame"),
    "a solver 1.3 times as slow, repeated": times(1.3, **TIME),
}
LOST = {
    "a method": lambda given: given.method != "skinning",
    "a seed": lambda given: (given.method, given.seed) != ("snug", 2),
    "a motion": lambda given: given.scene != SCENES[2],
    "a metric of a method": lambda given: (given.method, given.metric) != ("snug", "curvature/error"),
}


def found(one: list[Row], other: list[Row], **options) -> list[tuple[str, str, str, str]]:
    changes = compare(run_of(one), run_of(other), **options).changes
    return [(change.verdict, change.place, change.method, change.metric) for change in changes]


def fails(before: list[Row], after: list[Row]) -> bool:
    return any(verdict in (*FAILING, "changed") for verdict, *_ in found(before, after))


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_regression_is_caught(name):
    assert fails(a_run(0), [PLANTED[name](a_row) for a_row in a_run(1)])


@pytest.mark.parametrize("name", LOST)
def test_what_is_gone_is_caught_and_named_once(name):
    after = [a_row for a_row in a_run(1) if LOST[name](a_row)]
    lines = found(a_run(0), after)
    assert lines and {verdict for verdict, *_ in lines} == {"gone"} and len(lines) <= 3
    assert found(a_run(0), after, shared=True) == []


def test_other_seeds_other_times_and_round_off_are_no_change():
    alarms = sum(fails(a_run(2 * k), a_run(2 * k + 1)) for k in range(6))
    assert alarms == 0
    tiny = [times(1.0 - 1e-6, metric="energy/total")(a_row) for a_row in a_run(0)]
    assert not fails(a_run(0), tiny)


def test_a_motion_on_which_seeds_disagree_hides_no_change_of_another():
    broken = {"scene": SCENES[6], "seed": 1} | STRAIN
    before, after = ([times(40.0, **broken)(a_row) for a_row in a_run(draw)] for draw in (0, 1))
    assert not fails(before, after)
    assert fails(before, [times(3.0, scene=SCENES[0], **STRAIN)(a_row) for a_row in after])


def test_what_the_uncertainty_or_2_percent_covers_is_no_change():
    little, worse = ([times(factor, **SIMULATED)(a_row) for a_row in a_run()] for factor in (1.015, 1.1))
    assert found(a_run(), little) == []
    assert found(a_run(), worse) == [("worse", "tshirt", "simulation", "energy/strain")]
    unsure, sure = ([replace(r, uncertainty=0.5) for r in rows] for rows in (a_run(), worse))
    assert found(unsure, sure) == []
    unsure = [replace(r, uncertainty=0.3 * r.value) for r in a_run()]
    assert found(unsure, [times(0.2, scene=SCENES[0], **SIMULATED)(a_row) for a_row in unsure]) == []
    # The later run's own uncertainty hides nothing.
    assert found(a_run(), sure) == [("worse", "tshirt", "simulation", "energy/strain")]


def test_of_thousands_of_answers_the_farthest_by_chance_is_no_change():
    def drawn(seed: int) -> list[Row]:
        values = np.random.default_rng(seed).normal(10.0, 0.3, 3000)
        return [row(f"tshirt/{k}", "simulation", value=x, uncertainty=0.3) for k, x in enumerate(values)]

    before, after = drawn(0), drawn(1)
    assert not fails(before, after)
    assert fails(before, [replace(after[0], value=13.0), *after[1:]])


def test_a_correlation_of_the_other_sign_is_worse():
    def signed(sign: float) -> list[Row]:
        values = {(s, seed): sign * (0.8 + 0.01 * seed) for s in SCENES for seed in SEEDS}
        return [row(s, metric="dynamics/correlation", value=v, seed=k) for (s, k), v in values.items()]

    one, other = signed(1.0), signed(-1.0)
    assert found(one, other) == [("worse", "tshirt", "snug", "dynamics/correlation")]
    assert found(other, one) == [("better", "tshirt", "snug", "dynamics/correlation")]


def test_a_network_of_one_seed_is_judged_by_the_interval_of_the_seeds_of_the_earlier_run():
    later = [a_row for a_row in a_run(1) if a_row.seed == 0]
    assert not fails(a_run(0), [*later, *(r for r in a_run(1) if r.seed)])
    assert found(a_run(0), later, shared=True) == []
    worse = found(a_run(0), [times(3.0, **STRAIN)(a_row) for a_row in later], shared=True)
    assert {(verdict, *rest) for verdict, _, *rest in worse} == {("worse", "snug", "energy/strain")}


def test_a_check_off_by_more_than_its_tolerance_is_worse_whatever_it_says():
    for fields in ({}, {"tolerance": 5e-3}):
        later = [replace(r, value=0.284, **fields) if r.scene == "sag" else r for r in a_run()]
        assert found(a_run(), later) == [("worse", "sag", "simulation", "check")]
        assert found(later, later) == []  # an engine that violates a law is a result


@pytest.mark.parametrize(("spread", "factors"), [(3.0, (1.2, 1.3)), (12.0, (1.22, 1.6))])
def test_a_repeated_time_is_compared_on_one_machine_with_the_range_of_its_repeats(spread, factors):
    before = [replace(r, value=spread) if r.metric == "cost/spread" else r for r in a_run()]
    same, slower = ([times(factor, **TIME)(a_row) for a_row in before] for factor in factors)
    assert found(before, same) == []
    assert found(before, slower) == [("worse", "flag", "lbfgs-5", "cost/frame")]
    assert found(before, slower, times=False) == []
    assert found(before, [replace(a_row, hardware="another") for a_row in slower]) == []


def test_cells_of_two_protocols_are_refused():
    """A cell beside another reference is a user's own, though other rows of its run are of one protocol."""
    frozen = [replace(r, protocol="1.0") for r in a_run()]
    rows = [replace(r, protocol="own") if r.scene == SCENES[2] else r for r in frozen]
    with pytest.raises(ResultsError, match=r"motion_2 x snug: of protocol 1\.0 in A, own in B"):
        compare(run_of(frozen), run_of(rows))


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ({"preset": "quick"}, {"preset": "smoke"}, "preset quick in A"),
        ({"preset_values": {"frames": 20}}, {"preset_values": {"frames": 60}}, "frames 20 in A, 60 in B"),
        ({"body": ["a.npz", "1"]}, {"body": ["b.npz", "2"]}, r"body \['a.npz', '1'\] in A"),
    ],
)
def test_runs_of_other_scenes_are_refused_by_name(before, after, says):
    with pytest.raises(ResultsError, match=says):
        compare(run_of(a_run(), **before), run_of(a_run(), **after))


def test_steps_of_training_and_values_of_a_later_version_make_no_other_scenes():
    one = {"frames": 20, "steps": {"snug": 1}, "turns": 1.0}
    other = {"frames": 20, "steps": {"snug": 2}, "turns": 0.5, "new": 1}
    assert compare(run_of(a_run(), preset_values=one), run_of(a_run(), preset_values=other)).changes == ()


def test_where_zero_is_a_choice_no_change_hangs_on_it():
    """All gravity energies are higher by 50 J, or by none: the same change is found in both."""

    def heights(more: float, zero: float):
        rows = [
            row(scene, method, f"energy/{term}", zero + height + i)
            for i, scene in enumerate(SCENES)
            for method, height in (("simulation", 1.0), ("skinning", 2.0))
            for term in ("gravity", "total")
        ]
        solved = [zero + 1.1 + more + i for i in range(len(SCENES))]
        return rows + [row(s, "lbfgs-5", "energy/gravity", value) for s, value in zip(SCENES, solved)]

    # Patterns leave out simulation and skinning, or the total energy: the excess is of them all the same.
    moved = [("worse", "tshirt", "lbfgs-5", "relative_excess/gravity")]
    for zero, options in (
        (0.0, {}),
        (50.0, {"methods": "lbfgs-*"}),
        (50.0, {"metrics": "energy/gravity"}),
        (50.0, {"metrics": "relative_excess/gravity"}),
    ):
        assert found(heights(0.0, zero), heights(0.03, zero), **options) == moved
    assert found(heights(0.0, 50.0), heights(0.015, 50.0)) == []  # 1.5 % of skinning's excess


def test_a_cell_that_fails_and_a_check_that_is_off_are_worse():
    def ended(r: Row) -> Row:
        if r.scene == "sag":
            return replace(r, status="failed", value=0.5, reason="off")
        lost = r.method == "snug" and r.scene == SCENES[0] and r.seed == 1
        return replace(r, status="diverged", value=None, reason="step 7") if lost else r

    later = [ended(r) for r in a_run()]
    changes = [("worse", SCENES[0], "snug", "energy/strain"), ("worse", "sag", "simulation", "check")]
    assert found(a_run(), later) == found(a_run(), later, metrics="penetration/*") == changes
    assert [verdict for verdict, *_ in found(later, a_run())] == ["better", "better"]
    assert found(a_run(), later, methods="lbfgs-*") == []
    # A cell without numbers has one row, of a time.
    sound = [r for r in a_run() if (r.scene, r.method, r.seed) != (SCENES[0], "snug", 1)]
    lone = row(SCENES[0], "snug", "cost/frame", None, seed=1, status="failed", reason="no end")
    assert [verdict for verdict, *_ in found([*sound, lone], a_run())] == ["better"]
    for options in ({}, {"metrics": "penetration/*"}):
        assert [verdict for verdict, *_ in found(a_run(), [*sound, lone], **options)] == ["worse"]
    stalled = [replace(r, status="stalled") if r.scene == SCENES[0] else r for r in a_run()]
    assert {verdict for verdict, *_ in found(stalled, [*sound, lone])} == {"gone", "better"}


@pytest.mark.parametrize("fallen", [SCENES[:1], SCENES])
@pytest.mark.parametrize("seeds", [SEEDS, SEEDS[:1]])
def test_a_garment_that_fell_off_in_one_run_alone_is_worse_there(fallen, seeds):
    def totals(seeds, fallen=()):
        cells = [("simulation", 0, 1.0), ("skinning", 0, 2.0), *(("snug", seed, 1.1) for seed in seeds)]
        rows = [row(s, name, "energy/total", x, seed=k) for s in SCENES for name, k, x in cells]
        return [replace(r, value=-9.0) if r.method == "snug" and r.scene in fallen else r for r in rows]

    before, after = totals(SEEDS), totals(seeds, fallen)
    cells = [(scene, "snug", "relative_excess/total") for scene in fallen for _ in seeds]
    assert found(before, after, shared=True) == [("worse", *cell) for cell in cells]
    assert found(after, totals(seeds)) == [("better", *cell) for cell in cells]
    assert " worse" in compare(run_of(before), run_of(after), shared=True).headline["snug"][0]


@pytest.mark.parametrize(
    ("seeds", "note", "compared"),
    [(((0,), (0, 1)), "one seed", 1), (((0, 1), (1, 2)), "other seeds", 1), (((0, 1),) * 2, "same", 2)],
)
def test_a_network_that_nothing_judges_is_not_called_the_same(seeds, note, compared):
    cells = ([("simulation", 0), *(("snug", k) for k in of_run)] for of_run in seeds)
    one, other = ([row(s, m, "penetration/surface", seed=k) for s in SCENES for m, k in c] for c in cells)
    comparison = compare(run_of(one), run_of(other), shared=True)
    assert comparison.headline["snug"][2].endswith(f" {note}") and comparison.compared == compared


def test_run_times_are_of_the_scenes_in_which_solvers_were_timed_too():
    whole = [row(s, "snug", "cost/whole", x, unit="ms") for s, x in zip(SCENES, (9.0, 2.0))]
    rows = [row(SCENES[1], name, "cost/frame", 2.0, unit="ms") for name in ("snug", "lbfgs-5")]
    run = run_of([*a_run(), *whole, *rows])
    assert compare(run, run, times=True).headline["snug"][-1] == "2.00 → 2.00 same"


def test_exit_status_and_lines(tmp_path, capsys):
    run_folder(tmp_path / "a", a_run(0))
    run_folder(tmp_path / "b", [times(1.3, **STRAIN)(a_row) for a_row in a_run(1)])
    one, worse = str(tmp_path / "a"), str(tmp_path / "b")
    assert command.main([one, one]) == 0 and "0 worse" in capsys.readouterr().out
    assert command.main([one, worse, "--metrics", "*"]) == 1
    line = capsys.readouterr().out.splitlines()[0]
    assert line.startswith("worse   tshirt  snug  energy/strain  0.0")
    assert " J, × 1." in line and "p " in line
    assert command.main([worse, one]) == 0


def test_the_chief_metrics_of_each_method_stand_in_few_lines_snug_first(tmp_path, capsys):
    surface = {"metric": "penetration/surface", "unit": "%"}

    def inside(factor: float):
        for s in SCENES:
            yield from (row(s, f"solver-{k}", value=3.0, seeded=False, **surface) for k in range(20))
            yield row(s, "snug", value=2.0 * (factor if s == SCENES[0] else 1.0), **surface)
            yield row(s, "simulation", value=factor, **surface)
            yield from (row(s, "skinning", f"energy/t{m}", factor) for m in range(20))

    run_folder(tmp_path / "a", list(inside(1.0)))
    run_folder(tmp_path / "b", list(inside(4.0)))
    assert command.main([str(tmp_path / "a"), str(tmp_path / "b")]) == 1
    head, _, snug, simulation, solver, *rest = lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 30 and "| Surface inside [%] |" in head
    assert "| SNUG |" in snug and "2.00 → 2.75 one seed" in snug
    assert "| 1.00 → 4.00 worse |" in simulation and "| 3.00 → 3.00 same |" in solver
    assert rest[-1] == "Each change: --metrics '*'"


@pytest.mark.parametrize(
    ("metric", "before", "after", "verdicts"),
    [
        ("gap/energy", 0.0, 2.8e-17, []),
        ("gap/energy", 0.0, 1e-6, [WORSE]),
        ("dynamics/lag", -0.18, -0.19, []),
        ("dynamics/lag", -0.18, -0.30, [OTHER]),
    ],
)
def test_round_off_and_a_step_of_the_search_for_a_lag_are_no_change(metric, before, after, verdicts):
    runs = [run_of([row(SCENES[0], "simulation", metric, value)]) for value in (before, after)]
    assert [change.verdict for change in compare(*runs).changes] == verdicts


def test_a_scene_of_another_suite_is_compared_where_the_earlier_run_has_it():
    moved = [replace(a_row, suite="speed") if a_row.scene == SCENES[0] else a_row for a_row in a_run()]
    assert compare(run_of(a_run()), run_of(moved)).changes == ()
    assert compare(run_of(moved), run_of(a_run())).changes == ()


@pytest.mark.parametrize(
    ("b", "options", "says"),
    [
        ("none", [], "none"),
        ("a", ["--metrics", "energy/strian"], "nothing to compare"),
        ("spoilt", [], "results.csv of B is not as its run wrote it"),
    ],
)
def test_bad_input_is_one_line_and_status_2(tmp_path, refused, b, options, says):
    run_folder(tmp_path / "a", a_run())
    run_folder(tmp_path / "spoilt", a_run(), digests={"results.csv": "0" * 16})
    words = [str(tmp_path / "a"), str(tmp_path / b), *options]
    assert refused(says, command.main, words).startswith("reports.compare: ")


def test_a_run_says_whether_it_agrees_with_the_published_one_of_its_study(tmp_path):
    run_folder(tmp_path / "mine", a_run(), study={"name": "mine"})
    again = [a_row for a_row in a_run(1) if a_row.seed == 0]

    def line(rows: list[Row], name: str = "mine") -> str:
        return command.compare_published(run_of(rows, study={"name": name}), tmp_path)

    odd = [times(3.0, scene=SCENES[0], **STRAIN)(a_row) for a_row in again]
    assert line(again).startswith("published: reproduced (") and line(again, "other") == ""
    assert line(odd) == f"published: 1 numbers differ: SNUG in {SCENES[0]}"
