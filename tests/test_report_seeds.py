"""Several seeds in the report: ablations against the full recipe, bars, throughput. The rows are made up."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from report_folder import row
from scipy import stats

from benchmarks.methods import METHODS
from reports import bars, words
from reports.ablations import ABLATIONS, ablations, ablations_judged
from reports.document import document
from reports.scatter import TIE, apart, difference, scatter
from reports.summary import Mean, Measurements, dressed_scenes, wardrobe
from reports.tables import make_tables
from reports.throughput import throughput, throughput_bars


def seeds_of(method, metric, values, **more):
    return [row(method=method, metric=metric, value=value, seed=k, **more) for k, value in enumerate(values)]


def mean_of(values, method="snug"):
    mean = Measurements(seeds_of(method, "energy/strain", values)).mean(method, "energy/strain")
    assert mean is not None
    return mean


ONE = (1.0, 1.3, 1.1)


@pytest.mark.parametrize("shift", [0.1, 0.4, 0.5, 0.9])
def test_the_scatter_is_the_threshold_of_welchs_test(shift):
    other = (0.9 + shift, 1.5 + shift, 1.0 + shift, 1.1 + shift)
    apart = abs(mean_of(ONE).value - mean_of(other).value)
    beyond = apart > scatter(mean_of(ONE), mean_of(other))
    assert beyond == (stats.ttest_ind(ONE, other, equal_var=False).pvalue < 0.05)
    # What has no seeds is a known number; what could have had some is one draw more of the same scatter.
    s, t = mean_of(ONE).spread, stats.t.ppf(0.975, 2)
    assert scatter(mean_of(ONE), mean_of((2.0,), "simulation")) == pytest.approx(t * s * math.sqrt(1 / 3))
    assert scatter(mean_of((2.0,), "pbns"), mean_of(ONE)) == pytest.approx(t * s * math.sqrt(1 + 1 / 3))


def test_where_no_seeds_tell_it_the_scatter_is_a_share():
    assert scatter(mean_of((1.0,)), mean_of((-2.0,), "pbns")) == pytest.approx(2.0 * TIE)
    assert scatter(mean_of((1.0, 1.0)), mean_of((2.0, 2.0))) == 0.0


def test_positive_numbers_are_told_apart_by_their_factors():
    sound, broken = mean_of((0.36, 0.35, 0.37)), mean_of((1e7, 2e3, 6e6), "pbns")
    assert abs(sound.value - broken.value) < scatter(sound, broken)  # the spread of what broke hides it
    assert difference(sound, broken) == -1 and difference(broken, sound) == 1
    logs = [np.log([*mean.by_seed.values()]) for mean in (sound, broken)]
    factor = logs[0].mean() - logs[1].mean()
    assert stats.ttest_ind(*logs, equal_var=False).pvalue < 0.05
    share, least = apart(sound, broken)
    assert share == pytest.approx(np.exp(factor) - 1) and 0 < least < 1 and abs(share) > least
    for shift in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5):
        one, other = mean_of(ONE), mean_of((0.9 + shift, 1.5 + shift, 1.0 + shift), "pbns")
        logs = [np.log([*mean.by_seed.values()]) for mean in (one, other)]
        p = stats.ttest_ind(*logs, equal_var=False).pvalue
        assert bool(difference(one, other)) == (p < 0.05)


def test_other_numbers_are_told_apart_by_their_difference():
    one, other = mean_of((-0.1, 0.1, 0.0)), mean_of((1.0, 1.2, 1.1), "pbns")
    assert difference(one, other) == -1
    assert apart(one, other) == pytest.approx((-1.0, scatter(one, other) / 1.1))
    nothing = mean_of((0.0,), "simulation")
    assert apart(other, nothing) is None and difference(other, nothing) == 1 and difference(one, nothing) == 0
    assert apart(mean_of((1.0,)), mean_of((1.04,), "pbns"))[1] == pytest.approx(TIE)


def test_what_kin_draw_alike_is_no_scatter_between_them():
    """Every seed is 2 % better without the ingredient; between the seeds there are 30 %."""
    full, less = (1.0, 1.3, 1.1), (0.98, 1.275, 1.077)
    own = mean_of(full)
    assert difference(mean_of(less, "snug-no-inertia"), own) == -1
    assert stats.ttest_rel(np.log(less), np.log(full)).pvalue < 0.05
    share, least = apart(mean_of(less, "snug-no-inertia"), own)
    differences = np.log(less) - np.log(full)
    assert share == pytest.approx(np.expm1(differences.mean()))
    half = stats.t.ppf(0.975, 2) * differences.std(ddof=1) / np.sqrt(3)
    assert least == pytest.approx(-np.expm1(-half))
    # Other networks draw other numbers, and so do other seeds.
    assert difference(mean_of(less, "pbns"), own) == 0
    assert difference(mean_of((*less, 1.1), "snug-no-inertia"), own) == 0
    assert difference(mean_of(less, "snug+cleanup"), own) == -1


def test_a_seed_that_is_lost_is_said_wherever_the_mean_of_the_others_stands():
    rows = seeds_of("snug", "energy/total", (1.0, 1.1)) + seeds_of("pbns", "energy/total", (2.0, 2.1, 2.2))
    rows.append(row(metric="energy/total", value=None, seed=2, status="diverged", reason="no end"))
    rows += seeds_of("snug", "train/high_windows", (0.0, 0.0), suite="roll-outs", scene="training")
    mean = Measurements(rows).mean("snug", "energy/total")
    assert (mean.lost, mean.complete, mean.fewer) == (1, False, " (2 of 3 seeds)")
    findings = {line[0]: line[-1] for line in make_tables(rows)["findings"].rows}
    assert findings["A thousand frames end at most 5 % above where they began"] is None
    high = "Windows above 2 J once training has settled"
    assert met(rows)[high] == (0.0, "met")
    gone = row(metric="train/high_windows", value=None, seed=2, status="failed", reason="gone")
    assert met([*rows, dataclasses.replace(gone, suite="roll-outs", scene="training")])[high][1].startswith(
        "missed (2 of 3 seeds)"
    )


def test_one_networks_two_numbers_are_divided_seed_by_seed():
    rows = []
    for what, values in (("roll_out", (1.02, 2.04, 3.06)), ("window", (1.0, 2.0, 3.0))):
        rows += seeds_of("snug", f"train/{what}", values, suite="roll-outs", scene="training")
    (line,) = bars.table(rows).rows
    assert line[1].value == pytest.approx(2.0) and line[1].spread == pytest.approx(0.0, abs=1e-9)
    assert line[-1] == "met"


@pytest.mark.parametrize("entry", METHODS, ids=lambda entry: entry.name)
def test_the_report_knows_which_methods_have_seeds(entry):
    assert mean_of((1.0,), entry.name).seeded == entry.seeded


def test_garments_have_their_own_means_and_the_shirt_comes_first():
    rows = [row("tunic/stop", value=9.0), row("dressed/walk", value=1.0), row("dressed/kick", value=3.0)]
    measured = Measurements(rows)
    assert wardrobe(measured) == {"T-shirt": ("dressed/walk", "dressed/kick"), "Tunic": ("tunic/stop",)}
    assert dressed_scenes(Measurements(rows[:1])) == ("tunic/stop",)
    found = {line[0]: line[2].value for line in make_tables(rows)["energies"].rows}
    assert found == {"T-shirt": 2.0, "Tunic": 9.0}


def test_ablations_leave_the_other_tables_and_stand_below_the_full_recipe():
    rows = seeds_of("snug-no-noise", "energy/total", (2.0, 2.2, 2.4))
    rows += seeds_of("snug-window6", "energy/total", (1.0, 1.2, 1.4))
    rows += seeds_of("snug", "energy/total", (1.0, 1.1, 1.2))
    rows += seeds_of("snug", "roll_out/drift", (1.0, 1.1, 1.2), suite="roll-outs", scene="there_and_back")
    rows += seeds_of("snug-no-noise", "roll_out/drift", (0.1,), suite="roll-outs", scene="there_and_back")
    made = make_tables(rows)
    assert [line[1] for line in made["energies"].rows] == ["snug"]
    assert [line[1] for line in made["ablations"].rows] == ["snug", "snug-no-noise", "snug-window6"]
    full = made["ablations"].rows[0]
    assert full[-1] == Mean(pytest.approx(1.1), pytest.approx(0.1), scenes=1, seeds=3, complete=True)
    said = dict(words.findings(rows))["Ablations"]
    assert "of 2 ablations" in said and "1 in total energy and 0 in drift" in said
    assert said.endswith("in nothing: SNUG, windows of 6.")
    assert made["ablations_judged"].rows == (
        ("T-shirt", "snug-no-noise", "total energy", "drift of long roll-outs"),
        ("T-shirt", "snug-window6", "", ""),
    )


def test_without_the_full_recipe_nothing_is_compared():
    rows = [row(method=name, metric="energy/total") for name in ABLATIONS]
    assert ablations(rows) is None and ablations_judged(rows) is None
    assert ablations([row(metric="energy/total")]) is None


def test_without_the_full_recipe_ablations_stand_in_the_other_tables():
    cost = {"unit": "ms", "method": "snug-springs"}
    rows = [row(method="snug-springs", metric="energy/total"), row(metric="cost/frame", **cost)]
    rows.append(row(metric="cost/batch", **cost))
    full = [row(metric=r.metric) for r in rows]
    assert [line[1] for line in make_tables(rows)["energies"].rows] == ["snug-springs"]
    assert [line[1] for line in make_tables([*rows, *full])["energies"].rows] == ["snug"]
    assert [line[1] for line in throughput(rows).rows] == ["snug-springs"]
    assert [line[1] for line in throughput([*rows, *full]).rows] == ["snug"]


def on_two_scenes(method, *values, metric="energy/total"):
    scenes = ("dressed/walk", "dressed/kick")
    return [row(scene, method, metric, value) for scene, value in zip(scenes, values)]


def test_ablations_are_judged_over_the_scenes_that_both_have():
    rows = on_two_scenes("snug", 1.0, 9.0) + on_two_scenes("snug-no-noise", 2.0)
    assert ablations_judged(rows).rows == (("T-shirt", "snug-no-noise", "total energy (1 scene only)", ""),)
    assert "1 in total energy" in dict(words.findings(rows))["Ablations"]
    assert [line[7].value for line in ablations(rows).rows] == [5.0, 2.0]


def test_bars_compare_the_scenes_that_both_have_and_say_what_stalled():
    rows = on_two_scenes("snug", 1.05, 9.0)
    rows.append(row("dressed/walk", "free-bound", "energy/total", 1.0, status="stalled", reason="a frame"))
    line = bars.table(rows).rows[0]
    assert line[1].value == pytest.approx(5.0) and line[1].stalled and not line[1].complete
    assert line[-1] == "met (1 scene only)"


def met(rows):
    table = bars.table(rows)
    assert table is not None
    return {line[0]: (line[1].value, line[-1]) for line in table.rows}


def test_bars_are_met_missed_or_too_near_to_tell():
    rows = seeds_of("snug", "energy/total", (1.04, 1.05, 1.06))  # 3 from the bar, 2.5 of scatter
    rows += seeds_of("free-bound", "energy/total", (1.0,))
    assert met(rows)["Total above the free lower bound"] == (pytest.approx(5.0), "met")
    rows += seeds_of("snug", "energy/strain", (0.2, 0.4)) + seeds_of("skinning", "energy/strain", (1.2,))
    times = met(rows)["Strain below skinning's, so many times"]
    assert times == (pytest.approx(4.0), "within the scatter of seeds")
    ends = [("train/roll_out", (1.04, 1.04)), ("train/window", (1.0, 1.0)), ("train/high_windows", (0.0,))]
    rows += [r for name, v in ends for r in seeds_of("snug", name, v, suite="roll-outs", scene="training")]
    found = met(rows)
    high = seeds_of("snug", "train/high_windows", (0.0, 1.0, 17.0), suite="roll-outs", scene="training")
    assert met(high)["Windows above 2 J once training has settled"] == (6.0, "missed")  # by two of three
    assert found["Roll-outs on training motions, above windows"] == (pytest.approx(4.0), "missed")
    assert found["Windows above 2 J once training has settled"] == (0.0, "met")


def test_the_dynamic_recipe_is_judged_on_the_garment_that_swings():
    scene = {"scene": "tunic/twist_stop"}
    rows = [row(method="snug-dynamic", metric="dynamics/amplitude", value=0.6, **scene)]
    rows += [row(method="snug-dynamic", value=0.7, **scene), row(method="simulation", value=1.0, **scene)]
    found = met(rows)
    assert found["Tunic in twist_stop: A of the dynamic recipe"] == (0.6, "met")
    assert found["Its strain, off the simulation's"] == (pytest.approx(30.0), "missed")
    assert bars.table([row(method="simulation")]) is None


def test_bars_are_of_the_sizes_that_they_were_asked_for():
    rows = seeds_of("snug", "energy/total", (1.0,)) + seeds_of("free-bound", "energy/total", (1.0,))
    assert bars.table([dataclasses.replace(row, preset="quick") for row in rows]) is not None
    assert bars.table([dataclasses.replace(row, preset="smoke") for row in rows]) is None


def test_throughput_is_of_the_scenes_that_were_measured_both_ways(tmp_path):
    cost = {"unit": "ms", "method": "snug"}
    rows = [row(metric="cost/frame", value=0.5, **cost), row(metric="cost/batch", value=0.1, **cost)]
    rows += [row("dressed/jump", metric="cost/frame", value=9.0, **cost)]
    rows += [row(metric="cost/frame", value=70.0, unit="ms", method="simulation")]
    table = throughput(rows)
    assert table is not None
    assert [line[1] for line in table.rows] == ["snug"]
    assert table.rows[0][4:] == pytest.approx((2000.0, 10000.0, 5.0))
    (picture,) = throughput_bars(tmp_path, rows)
    assert picture.path.is_file() and throughput_bars(tmp_path, rows[-1:]) == []


def test_the_front_page_counts_what_came_out():
    rows = seeds_of("snug", "energy/strain", (1.0, 1.1)) + seeds_of("pbns", "energy/strain", (2.0, 2.1))
    rows += seeds_of("snug", "energy/bending", (1.0, 1.4)) + seeds_of("pbns", "energy/bending", (1.1, 1.5))
    rows += seeds_of("snug", "energy/gravity", (2.0, 2.1)) + seeds_of("pbns", "energy/gravity", (1.0, 1.1))
    said = dict(words.findings(rows))["The paper's findings"]
    assert said.startswith("Of 3 comparisons") and "1 come out as there, 1 lie within" in said
    assert said.endswith("1 do not come out.")


def test_the_page_says_how_many_seeds_there_were():
    rows = seeds_of("snug", "energy/strain", (1.0, 1.1, 1.2)) + seeds_of("pbns", "energy/strain", (2.0, 2.1))
    rows += seeds_of("simulation", "energy/strain", (1.0,))
    sections = document({}, rows, make_tables(rows), [], [])["sections"]
    notes = [block["note"] for section in sections for block in section["blocks"]]
    assert any("±: standard deviation over 2 or 3 seeds. Without it: one seed" in note for note in notes)
    assert not any("With one seed" in note for note in notes)
