"""Answer of README: a verdict in one sentence, and what SNUG is good and bad at, from a run's numbers."""

from __future__ import annotations

import math

from reports.blocks.page_one_sentences import ALIKE, GAP, SWING, secondary_motion
from reports.run.finished_run import Run
from reports.statistics.break_even import NETWORK, compared_scenes
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.pareto import fastest, points_of, run_time, truncated
from reports.statistics.relative_excess import excess_of, with_relative_excess
from reports.statistics.verdicts import compare_methods
from reports.tables.number_texts import number


def front_sentences(run: Run) -> str:
    """Return the verdict on SNUG and two bullets, as Markdown.

    Args:
        run: has SNUG, PBNS and the supervised network in whole motions, and SNUG beside solvers in clips.

    Raises:
        ValueError: a number of these is missing.
    """
    worn, cells = run.garment_rows, run.cells("speed", "garments")
    rows = with_relative_excess(run, worn)
    snug, pbns, supervised = (excess_of(run, rows, name) for name in (NETWORK, "pbns", "supervised"))
    swing, alike = (mean_of(worn, NETWORK, name) for name in (SWING, ALIKE))
    scenes = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(scenes)]
    points = points_of(run, cells, scenes, GAP)
    network = next((point for point in points if point.method == NETWORK), None)
    solver = fastest(truncated(run, points), network.error) if network else None
    faster = compare_methods(run, timed, run.metrics[run_time(timed)], run.reference, NETWORK).effect
    if not (snug and pbns and supervised and swing and alike and network and solver and faster):
        raise ValueError("the run lacks SNUG, PBNS, the supervised network, or their times beside solvers")
    worst, most = snug.worst
    least = min(faster.interval or (faster.shown,))
    power = 10 ** math.floor(math.log10(least))
    times = power * math.floor(least / power)  # one digit: the simulation's time is uncertain by half
    return "\n".join([
        f"**In a typical unseen motion SNUG removes {number(100.0 - snug.typical, 2)} % of the energy that "
        f"skinning has in excess of a converged simulation ({number(100.0 - snug.pooled, 2)} % pooled over "
        f"all motions), more than {times} times faster than that simulation; its garments have "
        f"{secondary_motion(swing.value)} secondary motion.**",
        "",
        f"- Good at: energy for its time. PBNS leaves {number(pbns.typical, 2)} % of that excess, the "
        f"supervised network {number(supervised.typical, 2)} %; solvers as accurate take at least "
        f"{number(solver.time / network.time, 1)} times as long.",
        f"- Bad at: dynamics and unfamiliar motion. Its hem moves {number(100.0 * swing.value, 1)} % as far "
        f"as the simulation's (correlation {number(alike.value, 2)}); the worst motion, "
        f"{worst.partition('/')[2]}, keeps {number(most, 2)} %.",
    ])  # fmt: skip
