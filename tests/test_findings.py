"""The table of the paper's findings: numbers decide, ties and what was not run are said."""

from __future__ import annotations

import pytest
from report_folder import SCENES, row, run_of

from reports.paper import CLAIMS, PRINTED, findings
from reports.tables import make_tables
from snug.recipes import TRAININGS


def told(rows):
    return {line[:3]: line[3:] for line in findings(run_of(rows))[0].rows}


def test_every_method_of_a_claim_is_one_that_can_be_run():
    known = {*TRAININGS, "simulation"}
    assert {name for _, *methods in CLAIMS for name in methods} <= known


@pytest.mark.parametrize(
    ("snug", "pbns", "verdict"),
    [
        ((0.5,), (1.0,), "reproduced"),
        ((0.97,), (1.0,), "within the scatter of seeds"),
        ((1.0,), (0.5,), "not reproduced: the other way round"),
        ((0.5, 0.6, 0.7), (1.0, 1.0, 1.0), "reproduced"),  # 0.4 apart, 0.25 of scatter
        ((0.7, 0.8, 0.9), (1.0, 1.0, 1.0), "within the scatter of seeds"),  # 0.2 apart, 0.25 of scatter
        ((0.6, 0.7, 0.8), (1.0,), "within the scatter of seeds"),  # 0.3 apart, 0.50: it has seeds of its own
    ],
)
def test_a_term_is_reproduced_beyond_a_tie_and_beyond_the_scatter_of_seeds(snug, pbns, verdict):
    rows = [row("tshirt/kick", "snug", value=value, seed=k) for k, value in enumerate(snug)]
    rows += [row("tshirt/kick", "pbns", value=value, seed=k) for k, value in enumerate(pbns)]
    unit, one, other, _, said = told(rows)["Strain", "snug", "pbns"]
    assert one.value == pytest.approx(sum(snug) / len(snug)) and (unit, said) == ("J", verdict)
    assert (one.spread is None) == (len(snug) == 1) and (other.spread is None) == (len(pbns) == 1)
    assert list(told(rows)) == [("Strain", "snug", "pbns")]  # what was not run is not judged


def test_means_are_compared_over_the_scenes_that_both_have():
    rows = [row(scene, "snug", value=value) for scene, value in zip(SCENES, (1.0, 9.0))]
    rows.append(row(SCENES[0], "pbns", value=2.0))
    _, one, other, apart, said = told(rows)["Strain", "snug", "pbns"]
    assert (one.value, other.value) == (1.0, 2.0) and not one.complete
    assert apart == pytest.approx(-50.0) and said == "reproduced (1 scene only)"
    rows[-1] = row("tshirt/other", "pbns", value=2.0)
    assert findings(run_of(rows)) == []


def test_without_a_network_there_is_no_table():
    assert findings(run_of([row(method="simulation")])) == []


def test_what_diverged_is_the_worse_one_and_not_a_dash():
    rows = [row(metric="energy/total")]
    line = ("Total", "snug", "snug-no-strain")
    assert findings(run_of(rows)) == []
    gone = {"metric": "cost/frame", "value": None, "status": "diverged", "reason": "nan"}
    diverged = told([*rows, row(method="snug-no-strain", **gone)])[line]
    assert diverged[2:] == (None, None, "reproduced: the second diverged")
    broken = [row(method="pbns"), row(method="snug", **gone)]
    assert told(broken)["Strain", "snug", "pbns"][-1] == "not reproduced: the first diverged"
    # Mean curvature is no error: having none is no verdict.
    smooth = [row(method="supervised", metric="curvature/mean", unit="1/m"), row(method="snug", **gone)]
    assert findings(run_of(smooth)) == []


def test_noise_is_judged_beside_zeros_and_not_as_an_ablation():
    found = {tuple(methods) for _, *methods in CLAIMS if "snug-noise-alone" in methods}
    assert found == {("snug-noise-alone", "snug-no-noise")}


def test_the_papers_numbers_stand_below_its_own_columns():
    made = make_tables(run_of([row(), row(metric="curvature/error", unit="1/m")]))
    assert dict(made["energies"].references) == PRINTED["energies"]
    assert made["energies"].references[1][1]["energy/strain"] == "0.064"
    assert dict(made["curvature"].references) == PRINTED["curvature"]
