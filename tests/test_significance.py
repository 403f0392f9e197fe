"""When two means are called different: by a test of scipy.stats, or by a share where nothing was repeated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from report_folder import row, run_of
from scipy import stats

from reports.means import mean_of
from reports.significance import TIE, difference, p_value, relative_difference


def mean_of_seeds(values, method="snug"):
    rows = [row(method=method, value=value, seed=k) for k, value in enumerate(values)]
    mean = mean_of(run_of(rows).frame, method, "energy/strain")
    assert mean is not None
    return mean


ONE = (1.0, 1.3, 1.1)


@pytest.mark.parametrize("shift", [0.1, 0.4, 0.5, 0.9])
def test_two_networks_are_told_apart_by_welchs_test(shift):
    """Of the numbers themselves where one is not positive: t_{.975, nu} sqrt(s1^2/n1 + s2^2/n2) by hand."""
    one, other = np.array(ONE) - 1.2, np.array((0.9, 1.5, 1.0, 1.1)) + shift - 1.2
    parts = [values.var(ddof=1) / len(values) for values in (one, other)]
    freedom = sum(parts) ** 2 / sum(part**2 / (len(v) - 1) for part, v in zip(parts, (one, other)))
    threshold = stats.t.ppf(0.975, freedom) * math.sqrt(sum(parts))
    apart = other.mean() - one.mean()
    expected = 0 if abs(apart) <= threshold else -int(np.sign(apart))
    assert difference(mean_of_seeds(one), mean_of_seeds(other, "pbns")) == expected


@pytest.mark.parametrize(("method", "freed"), [("simulation", 1 / 3), ("pbns", 1 + 1 / 3)])
def test_one_number_beside_several_seeds(method, freed):
    """What no seed changes is a known number; what could have seeds is one draw more of the same scatter."""
    several = mean_of_seeds(np.array(ONE) - 1.2)
    threshold = stats.t.ppf(0.975, 2) * several.spread * math.sqrt(freed)
    for share, expected in ((0.99, 0), (1.01, 1)):
        one = mean_of_seeds((several.value + share * threshold,), method)
        assert difference(one, several) == expected and difference(several, one) == -expected


def test_where_no_seeds_tell_it_the_scatter_is_a_share():
    for other, expected in ((1.0 - 1.01 * TIE, 1), (1.0 - 0.99 * TIE, 0)):
        assert difference(mean_of_seeds((1.0,)), mean_of_seeds((other,), "pbns")) == expected
    assert p_value(mean_of_seeds((1.0,)), mean_of_seeds((1.0,), "pbns")) is None
    # Two that give the same with every seed have no scatter at all.
    assert difference(mean_of_seeds((1.0, 1.0)), mean_of_seeds((1.001, 1.001), "pbns")) == -1
    assert difference(mean_of_seeds((1.0, 1.0)), mean_of_seeds((1.0, 1.0), "pbns")) == 0


def test_positive_numbers_are_told_apart_by_their_factors():
    sound, broken = mean_of_seeds((0.36, 0.35, 0.37)), mean_of_seeds((1e7, 2e3, 6e6), "pbns")
    values = [[*mean.by_seed.values()] for mean in (sound, broken)]
    assert stats.ttest_ind(*values, equal_var=False).pvalue > 0.05  # the spread of what broke hides it
    assert difference(sound, broken) == -1 and difference(broken, sound) == 1
    factor = np.log(values[0]).mean() - np.log(values[1]).mean()
    assert relative_difference(sound, broken) == pytest.approx(np.exp(factor) - 1)
    for shift in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5):
        one, other = mean_of_seeds(ONE), mean_of_seeds((0.9 + shift, 1.5 + shift, 1.0 + shift), "pbns")
        logs = [np.log([*mean.by_seed.values()]) for mean in (one, other)]
        p = stats.ttest_ind(*logs, equal_var=False).pvalue
        assert bool(difference(one, other)) == (p < 0.05)


def test_other_numbers_are_told_apart_by_their_difference():
    one, other = mean_of_seeds((-0.1, 0.1, 0.0)), mean_of_seeds((1.0, 1.2, 1.1), "pbns")
    assert difference(one, other) == -1
    assert relative_difference(one, other) == pytest.approx(-1.0)
    nothing = mean_of_seeds((0.0,), "simulation")
    assert relative_difference(other, nothing) is None
    assert difference(other, nothing) == 1 and difference(one, nothing) == 0
    assert difference(nothing, mean_of_seeds((0.0,), "pbns")) == 0


def test_what_a_pairing_group_draws_alike_is_no_scatter_between_its_methods():
    """Every seed is 2 % better without the ingredient; between the seeds there are 30 %."""
    full, less = (1.0, 1.3, 1.1), (0.98, 1.275, 1.077)
    own = mean_of_seeds(full)
    assert difference(mean_of_seeds(less, "snug-no-inertia"), own) == -1
    assert p_value(mean_of_seeds(less, "snug-no-inertia"), own) == stats.ttest_rel(less, full).pvalue
    share = relative_difference(mean_of_seeds(less, "snug-no-inertia"), own)
    assert share == pytest.approx(np.expm1((np.log(less) - np.log(full)).mean()))
    assert difference(mean_of_seeds(less, "snug+cleanup"), own) == -1
    # Other networks draw other numbers, and so do other seeds.
    assert difference(mean_of_seeds(less, "pbns"), own) == 0
    assert difference(mean_of_seeds((*less, 1.1), "snug-no-inertia"), own) == 0
    assert difference(mean_of_seeds(full, "snug-no-inertia"), own) == 0


def test_the_order_of_the_seeds_does_not_pair_them():
    rows = [row(method="snug-no-inertia", value=v, seed=k) for k, v in ((2, 1.077), (0, 0.98), (1, 1.275))]
    turned = mean_of(run_of(rows).frame, "snug-no-inertia", "energy/strain")
    assert difference(turned, mean_of_seeds((1.0, 1.3, 1.1))) == -1
