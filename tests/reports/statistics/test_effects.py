"""Effects, their intervals and p-values over motions and seeds, by known answers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from reports.statistics import effects, means_and_spreads
from reports.statistics.effects import (
    DIFFERENCE,
    EXCESS,
    RANGE,
    RATIO,
    cost_effect,
    effect,
    rescale,
    unscale,
)
from reports.statistics.means_and_spreads import Mean, mean_of, pair
from tests.reports.report_folder import row, run_of


def mean_over(grid, method="snug"):
    """Return the mean over rows with the values grid[motion][seed]."""
    rows = [
        row(f"tshirt/{m}", method, value=float(value), seed=s)
        for m, values in enumerate(np.atleast_2d(grid))
        for s, value in enumerate(values)
    ]
    mean = mean_of(run_of(rows).frame, method, "energy/strain")
    assert mean is not None
    return mean


ONE = np.array((1.0, 1.3, 1.1))
LESS = ONE * (0.98, 0.985, 0.975)  # 2 % below with every seed, between which there are 30 %
NOISE = 0.02  # relative, of an error that 10,000 draws estimate; three standard deviations


def t_interval(value, error, freedom):
    return value + stats.t.ppf((0.025, 0.975), freedom) * error


def welch(*samples):
    """Standard error of the difference of two means, and its degrees of freedom, by hand."""
    parts = [values.var(ddof=1) / len(values) for values in samples]
    shares = (part**2 / (len(values) - 1) for part, values in zip(parts, samples))
    return math.sqrt(sum(parts)), sum(parts) ** 2 / sum(shares)


BELOW, FOUR = ONE - 1.2, np.array((0.9, 1.5, 1.0, 1.1)) - 0.7  # not all are positive
# Motions are drawn for both at once, so what one of them asks of both is no scatter.
TALL, APART = np.array([[0.1], [5.0], [-3.0], [9.0]]), np.array([[0.1], [0.2], [0.2], [0.1]])


@pytest.mark.parametrize(
    ("one", "method", "other", "covers", "error", "freedom"),
    [
        (BELOW, "pbns", FOUR, "seeds", *welch(BELOW, FOUR)),
        (TALL, "pbns", TALL - APART, "motions", APART.std(ddof=1) / 2.0, 3.0),
        # A method without seeds has no scatter; one run of a seeded method is one more draw of the
        # scatter.
        (BELOW, "simulation", [[-0.4]], "seeds", BELOW.std(ddof=1) * math.sqrt(1 / 3), 2.0),
        (BELOW, "pbns", [[-0.4]], "seeds", BELOW.std(ddof=1) * math.sqrt(4 / 3), 2.0),
    ],
    ids=["seeds of both", "motions", "no seeds", "one seed"],
)
def test_the_interval_is_students_over_what_was_repeated(one, method, other, covers, error, freedom):
    comparison = effect(mean_over(one), mean_over(other, method))
    assert comparison.scale == DIFFERENCE and comparison.covers == covers
    assert comparison.shown == pytest.approx(np.mean(one) - np.mean(other))
    assert comparison.freedom == pytest.approx(freedom, rel=3 * NOISE)
    low, high = t_interval(comparison.shown, error, comparison.freedom)
    assert comparison.interval == pytest.approx((low, high), abs=NOISE * (high - low))


def test_seeds_of_a_pairing_group_are_drawn_at_once_and_others_by_themselves():
    alike = effect(mean_over(LESS, "snug-no-inertia"), mean_over(ONE))
    logs = np.log(LESS) - np.log(ONE)
    low, high = np.exp(t_interval(logs.mean(), logs.std(ddof=1) / math.sqrt(3.0), 2))
    assert alike.interval == pytest.approx((low, high), rel=NOISE) and alike.p_value() < 0.05
    later = [row(method="snug-no-inertia", value=v, seed=k) for k, v in enumerate(LESS, 1)]
    later = mean_of(run_of(later).frame, "snug-no-inertia", "energy/strain")
    for other in (mean_over(LESS, "pbns"), mean_over([*LESS, 1.1], "snug-no-inertia"), later):
        # Other networks and seeds draw other numbers.
        assert effect(other, mean_over(ONE)).p_value() > 0.5
    rows = [row(method="snug-no-inertia", value=LESS[k], seed=k) for k in (2, 0, 1)]
    turned = mean_of(run_of(rows).frame, "snug-no-inertia", "energy/strain")
    assert effect(turned, mean_over(ONE)) == alike  # by their number, not their order


def random_means(random, paired, spread):
    """Two means of a crossed design: what a motion asks of both; spread of motions, of seeds, of the rest."""
    shared = random.normal(0.0, 5.0, (4, 1))
    means = []
    for name in ("one", "other"):
        parts = (random.normal(0.0, size, shape) for size, shape in zip(spread, ((4, 1), (1, 3), (4, 3))))
        grid = sum(parts, shared)
        cells = {(str(m), s): float(value) for (m, s), value in np.ndenumerate(grid)}
        group = "both" if paired else name
        means.append(Mean(float(grid.mean()), None, 3, True, cells=cells, pairing_group=group))
    return means


def covered(paired, spread, times=400):
    random = np.random.default_rng(3)
    intervals = [effect(*random_means(random, paired, spread)).interval for _ in range(times)]
    return np.mean([low <= 0.0 <= high for low, high in intervals])


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("spread", [(1.0, 1.0, 0.0), (1.0, 0.3, 0.3), (0.3, 1.0, 0.3)])
def test_of_four_motions_and_three_seeds_95_percent_of_the_intervals_hold_the_truth(
    paired, spread, monkeypatch
):
    assert 0.90 <= covered(paired, spread) <= 0.98
    if spread[1] == 1.0:
        return
    # Seeds alone cover too little where motions scatter.
    weights = effects._weights
    monkeypatch.setattr(
        effects, "_weights", lambda n, s: np.full((10_000, n), 1.0 / n) if s == 0 else weights(n, s)
    )
    assert covered(paired, spread) < 0.9


SEGMENTS = [*(f"tshirt/01_01_{x}" for x in "abcdefg"), *(f"tshirt/02_07_{x}" for x in "abcdef")]
MOTIONS = [*SEGMENTS, *(f"tshirt/{k:02d}_03" for k in range(3, 8)), "tshirt/kick", "tshirt/punch"]


def test_a_mean_is_over_sources_of_motion_of_which_the_segments_of_a_recording_are_one():
    values = {"01_01_a": 1.0, "01_01_b": 3.0, "kick": 10.0}
    rows = [row(f"tshirt/{motion}", value=x, uncertainty=x) for motion, x in values.items()]
    mean = mean_of(run_of(rows).frame, "snug", "energy/strain")
    assert (mean.value, mean.uncertainty, len(mean.cells)) == (6.0, 6.0, 3)


@pytest.mark.parametrize("alike", [0.0, 0.5, 1.0])
def test_segments_of_a_recording_are_no_independent_motions(alike, monkeypatch):
    recordings = [means_and_spreads.recording_of(scene) for scene in MOTIONS]
    _, place = np.unique(recordings, return_inverse=True)
    assert place.max() == 8
    assert means_and_spreads.recording_of("tshirt/01_01_a@clip") == "tshirt/01_01@clip"
    random = np.random.default_rng(5)

    def interval():
        values = alike**0.5 * random.normal(size=9)[place] + (1 - alike) ** 0.5 * random.normal(size=20)
        cells = {(scene, 0): float(value) for scene, value in zip(MOTIONS, values)}
        one = Mean(float(values.mean()), None, 1, 20, seeded=False, cells=cells)
        far = effect(one, replace(one, value=0.0, cells=dict.fromkeys(cells, 0.0)), DIFFERENCE)
        return far.interval

    def held():
        return np.mean([low <= 0.0 <= high for low, high in (interval() for _ in range(400))])

    assert 0.93 <= held() <= 0.98
    same = {(scene, 0): 99.7 for scene in MOTIONS}
    constant = Mean(99.7, None, 1, 20, seeded=False, cells=same)
    other = replace(constant, cells=dict.fromkeys(same, 0.1))
    assert effect(constant, other, DIFFERENCE).interval is None
    if alike:
        monkeypatch.setattr(means_and_spreads, "recording_of", lambda scene: scene)
        assert held() < 0.85


def test_positive_numbers_are_compared_by_their_factors():
    sound, broken = mean_over((0.36, 0.35, 0.37)), mean_over((1e7, 2e3, 6e6), "pbns")
    ratio = effect(sound, broken)
    logs = [np.log([*mean.cells.values()]) for mean in (sound, broken)]
    assert ratio.scale == RATIO and ratio.shown == pytest.approx(np.exp(logs[0].mean() - logs[1].mean()))
    assert ratio.p_value() < 0.05  # though the spread of what broke is larger than the difference
    low, high = ratio.interval
    assert 0.0 < low < ratio.shown < high < 1.0
    back = effect(broken, sound)
    assert np.log(back.interval) == pytest.approx(-np.log((high, low)), rel=3 * NOISE)
    # Where the interval ends at zero the p-value is the level.
    at_end, inside, outside = (
        replace(ratio, value=ratio.value - np.log(x * high)) for x in (1, 0.99, 1.01)
    )
    assert at_end.p_value() == pytest.approx(0.05) and inside.p_value() > 0.05 > outside.p_value()
    assert effect(mean_over((0.0, 1.0)), mean_over((1.0, 1.0), "pbns")).scale == DIFFERENCE


def test_what_is_the_same_with_every_motion_was_not_repeated():
    """A training has one time, whatever the motions that its network is tested on; a size is one number."""
    times = [np.repeat([values], 4, axis=0) for values in (ONE, 50.0 * ONE)]
    several = effect(mean_over(times[0]), mean_over(times[1], "pbns"))
    alone = effect(mean_over(times[0][:1]), mean_over(times[1][:1], "pbns"))
    assert several.covers == "seeds" and several.interval == pytest.approx(alone.interval, rel=1e-9)
    for cut in (np.s_[:, :1], np.s_[:, [0, 0, 0]]):
        comparison = effect(mean_over(times[0][cut]), mean_over(times[1][cut], "pbns"))
        assert (comparison.covers, comparison.interval, comparison.p_value()) == ("", None, None)


def test_what_every_motion_repeats_exactly_is_certain():
    twice = effect(mean_over([[1.0], [2.0], [4.0]]), mean_over([[2.0], [4.0], [8.0]], "pbns"))
    assert twice.covers == "motions" and twice.interval == pytest.approx((0.5, 0.5))
    assert twice.p_value() == pytest.approx(0.0)
    same = mean_over([[1.0], [2.0], [4.0]])
    assert effect(same, replace(same, pairing_group="")).p_value() == 1.0


def test_shares_of_excess_are_compared_by_logarithm_above_one_percent_and_by_difference_below():
    shares = np.array((-0.3, 0.0, 0.01, 60.0, 120.0))
    assert unscale(rescale(shares, EXCESS), EXCESS) == pytest.approx(shares)
    assert rescale(120.0, EXCESS) - rescale(60.0, EXCESS) == pytest.approx(math.log(2.0), abs=1e-3)
    assert rescale(0.02, EXCESS) - rescale(0.01, EXCESS) == pytest.approx(0.01, rel=1e-3)
    motions = np.array([[2.0], [4.0], [8.0], [16.0]])
    comparison = effect(mean_over(motions), mean_over(0.0 * motions, "simulation"), EXCESS)
    logs = np.arcsinh(motions)
    assert comparison.shown == pytest.approx(np.sinh(logs.mean())) and comparison.shown < motions.mean()
    ends = np.sinh(t_interval(logs.mean(), logs.std(ddof=1) / 2.0, 3))
    assert comparison.interval == pytest.approx(tuple(ends), rel=3 * NOISE)
    halved = effect(mean_over(0.5 * motions), mean_over(motions, "pbns"), EXCESS)
    assert halved.shown == pytest.approx(-0.5 * comparison.shown, rel=0.1) and halved.interval[1] < 0.0
    # Points between two shares are the same in either order.
    large = motions * np.array([[90.0], [150.0], [70.0], [120.0]])
    difference = effect(mean_over(motions), mean_over(large, "pbns"), EXCESS)
    back = effect(mean_over(large), mean_over(motions, "pbns"), EXCESS)
    assert difference.shown == pytest.approx(-back.shown)
    low, high = difference.interval
    assert (low, high) == pytest.approx((-back.interval[1], -back.interval[0]), rel=3 * NOISE)
    assert high - low > 0.2 * abs(difference.shown)  # the uncertainty of the larger one is seen


def test_a_cost_has_the_range_of_what_was_measured_and_no_interval():
    costs, other = np.array([[2.0, 2.2], [3.0, 3.3]]), np.array([[4.0, 4.0], [9.0, 9.0]])
    comparison = cost_effect(mean_over(costs), mean_over(other, "pbns"))
    assert comparison.covers == RANGE and comparison.p_value() is None
    assert comparison.interval == pytest.approx((3.0 / 9.0, 2.2 / 4.0))
    alone = cost_effect(mean_over(2.0), mean_over(4.0, "pbns"))
    assert (alone.covers, alone.interval, alone.shown) == (RANGE, None, 0.5)


TWINS = ("simulation-perturbed-1e-4", "simulation-dt/4", "simulation-dt/4-perturbed-1e-4")


def moved_means(changes):
    """Two means over the same motions: method -> change of each motion by each member of the family."""
    rows = [
        replace(row(f"tshirt/{scene}", method, value=value), moved=tuple(zip(TWINS, moved)))
        for method, value in (("snug", 1.0), ("pbns", 1.3))
        for scene, moved in enumerate(changes[method])
    ]
    return pair(run_of(rows).frame, "snug", "pbns", "energy/strain")


def test_two_starts_make_the_noise_and_smaller_steps_a_trend_that_may_turn_the_sign():
    """Each member takes the reference's place in all motions at once."""
    none = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    snug = ((0.2, 1.0, 1.3), (0.4, 1.4, 1.5))
    comparison = effect(*moved_means({"snug": snug, "pbns": none}), DIFFERENCE)
    assert comparison.uncertainty == pytest.approx(math.sqrt((0.3**2 + 0.2**2) / 4.0))
    assert comparison.against == pytest.approx({TWINS[1]: 1.2, TWINS[2]: 1.4})
    assert comparison.value == pytest.approx(-0.3) and comparison.find_reversals() == list(TWINS[1:])
    # What a member does to both methods moves them not apart, on the scale of the test.
    result = effect(*moved_means({"snug": snug, "pbns": snug}), DIFFERENCE)
    assert result.uncertainty == pytest.approx(0.0) and result.find_reversals() == []
    logs = [np.log(1.0 + np.array(moves)).mean() for moves in zip(*snug)]
    noise = math.sqrt((logs[0] ** 2 + (logs[1] - logs[2]) ** 2) / 4.0)
    assert effect(*moved_means({"snug": snug, "pbns": none})).uncertainty == pytest.approx(noise)
    # A member that is missing in one motion did not leave that motion as it was: it takes no part.
    one, other = moved_means({"snug": snug, "pbns": none})
    first, *_ = one.moved
    third = replace(one, moved=one.moved | {first: one.moved[first] | {"simulation-dt/8": -5.0}})
    assert effect(third, other, DIFFERENCE).against == comparison.against
    # One that stalled in one motion of three moves the value as in the other two.
    most = effect(*moved_means({"snug": (*snug, (9.0,)), "pbns": (*none, (0.0,))}), DIFFERENCE)
    assert most.against == pytest.approx(comparison.against)
    assert most.uncertainty == comparison.uncertainty
    # Smaller steps alone have no noise.
    trend = effect(*moved_means({"snug": ((0.0,), (0.0,)), "pbns": ((), ())}), DIFFERENCE)
    assert trend.uncertainty == 0.0


def test_uncertainties_of_two_runs_add_up_as_independent_ones():
    rows = [row(method=method, value=value) for method, value in (("snug", 2.0), ("pbns", 4.0))]
    frame = run_of(rows).frame
    one, other = pair(frame.assign(uncertainty=[0.3, 0.4]), "snug", "pbns", "energy/strain")
    assert effect(one, other, DIFFERENCE).uncertainty == pytest.approx(0.5)
    assert effect(one, other, RATIO).uncertainty == pytest.approx(math.hypot(0.15, 0.1))
