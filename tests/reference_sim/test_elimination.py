"""Elimination of small graphs against the pattern of a dense factor."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from reference_sim.elimination import eliminate, supernodes

COUNT = 30


def graph(seed):
    """Return an order and pairs of vertices, and the pattern of the factor, dense."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(COUNT)
    pairs = rng.integers(COUNT, size=(2 * COUNT, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    return order, pairs, filled(order, pairs)


def filled(order, pairs):
    """Return what is not zero below the diagonal, column by column."""
    place = np.argsort(order)
    pattern = np.zeros((COUNT, COUNT), bool)
    for i, j in place[pairs]:
        pattern[max(i, j), min(i, j)] = True
    for j in range(COUNT):
        rows = np.flatnonzero(pattern[:, j])
        for i in rows:
            for k in rows[rows > i]:
                pattern[k, i] = True
    return pattern


@pytest.mark.parametrize("seed", range(5))
def test_parents_and_counts_are_those_of_the_filled_matrix(seed):
    order, pairs, pattern = graph(seed)
    starts, columns, parents, counts = eliminate(order, pairs)
    assert np.array_equal(counts, pattern.sum(axis=0))
    for j in range(COUNT):
        rows = np.flatnonzero(pattern[:, j])
        assert parents[j] == (rows[0] if len(rows) else -1)
        row = columns[starts[j] : starts[j + 1]]
        assert pattern[j, row].all()
    assert len(columns) == len(pairs)


@pytest.mark.parametrize("seed", range(5))
def test_supernodes_hold_the_filled_matrix(seed):
    order, pairs, _ = graph(seed)
    order, first, above, below, rows = supernodes(order, pairs)
    pattern = filled(order, pairs)
    assert np.array_equal(np.sort(order), np.arange(COUNT))
    assert first[0] == 0 and first[-1] == COUNT
    assert len(first) < COUNT
    for s, (start, end) in enumerate(pairwise(first)):
        own = rows[below[s] : below[s + 1]]
        assert (np.diff(own) > 0).all()
        assert (own >= end).all()
        for j in range(start, end):
            beyond = np.flatnonzero(pattern[end:, j]) + end
            assert set(beyond) <= set(own)
        last = np.flatnonzero(pattern[:, end - 1])
        assert set(own) == set(last)
        if above[s] >= 0:
            inside = np.arange(first[above[s]], COUNT)
            assert set(own) <= set(inside)
            assert own[0] < first[above[s] + 1]
        else:
            assert len(own) == 0
