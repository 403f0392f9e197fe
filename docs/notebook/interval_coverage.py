"""Coverage of intervals and rates of verdicts, by simulated relative excesses and the code that judges.

    python docs/notebook/interval_coverage.py --times 1000

prints the tables of statistics.md. Excesses are lognormal over motions, with scatter of seeds and
of single cells, and noise of the reference, which can bring it below zero.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from reports.statistics.effects import DIFFERENCE, EXCESS, effect, rescale, unscale
from reports.statistics.means_and_spreads import Mean
from reports.statistics.verdicts import decide

MEDIAN, SEEDS, CELLS, NOISE = 5.0, 0.1, 0.2, 0.3  # %; standard deviations of logarithms; %


def excesses(random: np.random.Generator, motions: int, seeds: int, spread: float, factor: float = 1.0):
    """Draw relative excesses (motions, seeds) [%] of two networks on the same motions."""
    shared = random.normal(0.0, spread, (motions, 1))
    noise = random.normal(0.0, NOISE, (motions, 1))
    grids = []
    for scale in (1.0, factor):
        errors = random.normal(0.0, SEEDS, (1, seeds)) + random.normal(0.0, CELLS, (motions, seeds))
        grids.append(scale * MEDIAN * np.exp(shared + errors) + noise)
    return grids


def mean_of(grid: np.ndarray, group: str) -> Mean:
    """Return the mean over motions and seeds of a grid (motions, seeds)."""
    cells = {(str(m), s): float(grid[m, s]) for m, s in np.ndindex(grid.shape)}
    return Mean(float(grid.mean()), None, grid.shape[1], grid.size, cells=cells, pairing_group=group)


def main() -> None:
    """Print coverage and rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=1000)
    times = parser.parse_args().times
    for motions in (5, 8, 20):
        for spread in (0.5, 1.0, 1.5):
            random = np.random.default_rng(motions)
            many = excesses(random, 4000, 1000, spread)[0]
            truth = {scale: np.mean(rescale(many, scale)) for scale in (EXCESS, DIFFERENCE)}
            held = Counter()
            for _ in range(times):
                one = mean_of(excesses(random, motions, 3, spread)[0], "one")
                zero = mean_of(np.zeros((motions, 3)), "zero")
                for scale in truth:
                    low, high = effect(one, zero, scale).interval
                    held[scale] += low <= unscale(truth[scale], scale) <= high
            print(
                "coverage", motions, spread, {scale: held[scale] / times for scale in truth}, flush=True
            )
    for motions in (8, 20):
        for factor in (1.0, 1.02, 1.1, 1.5, 2.0):
            random, verdicts = np.random.default_rng(7), Counter()
            for _ in range(times // 4):
                one, other = excesses(random, motions, 3, 1.0, factor)
                far = effect(mean_of(one, "one"), mean_of(other, "other"), EXCESS)
                verdicts[decide(far, far.p_value())] += 1
            print(
                "verdict", motions, factor, {k: v / (times // 4) for k, v in verdicts.items()}, flush=True
            )


if __name__ == "__main__":
    main()
