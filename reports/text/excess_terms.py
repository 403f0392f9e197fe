"""Which energies a method's excess over the reference consists of, as a sentence."""

from __future__ import annotations

from reports.blocks.page_one_sentences import listed
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import pair
from reports.statistics.relative_excess import TOTAL
from reports.tables.number_texts import number

LEAST = 1.0  # [%] of the excess: smaller terms are not named


def excess_terms(run: Run, method: str) -> str:
    """Say how much energy a method has above the reference, and which terms it is, the largest first.

    Energies are means over the motions and seeds of the first garment.

    Raises:
        ValueError: where the run has no total energy of the method and the reference.
    """
    rows = run.garment_rows
    rows = rows[rows["garment"] == run.first_garment]
    names = dict.fromkeys(term for terms in set(rows["terms"]) for term in terms.split("+") if term)
    excess = {}
    for name in (TOTAL, *(f"energy/{term}" for term in names)):
        one, zero = pair(rows, method, run.reference, name)
        if one is not None and zero is not None:
            excess[name] = one.value - zero.value
    if TOTAL not in excess:
        raise ValueError(f"the run has no total energy of {method} and of its reference")
    total = excess.pop(TOTAL)
    shares = {name: 100.0 * value / total for name, value in excess.items()}
    largest = sorted((name for name in shares if abs(shares[name]) >= LEAST), key=lambda name: -shares[name])
    parts = [f"{number(shares[name], 2)} % {run.metrics[name].title.lower()}" for name in largest]
    above = f"The mean energy of {run.label(method)} above the reference's, {number(total)} J"
    return f"{above}, is {listed(parts)}."
