"""Styles of methods: the same colour and marker in every figure, from family, role and base.

Colours are those of Okabe and Ito (2008), told apart under every common colour-vision deficiency;
the marker repeats what the colour says, for print in grey.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import dataclass, replace

from reports.run.finished_run import ReportedMethod, Run

Line = str | tuple[float, tuple[float, ...]]  # matplotlib's: a name, or an offset and the dashes [points]


@dataclass(frozen=True)
class Style:
    """Style of a method or family: label for people, colour, matplotlib marker and line."""

    label: str
    colour: str
    marker: str
    line: Line = "-"


# By family; a method that shares its family with none is one by itself. Only families that are drawn as one
# line have a label here: any other label is the method's own.
KNOWN = {
    "simulation": Style("", "#000000", "*"),
    "simulation-perturbed": Style("", "#444444", "x", "--"),
    "direct-optimisation": Style("", "#5D3A9B", "_", "--"),
    "skinning": Style("", "#8C8C8C", "D", "--"),
    "untrained": Style("", "#56B4E9", "v", ":"),
    "pbns": Style("", "#009E73", "^", "-."),
    "pbns-springs": Style("", "#117733", "^", ":"),
    "pbns-paper": Style("", "#00725A", "^", "--"),
    "tailornet": Style("", "#661100", "H", ":"),
    "santesteban2019": Style("", "#AA4499", "d", (0.0, (1.0, 1.0))),
    "nearest-poses": Style("", "#A6761D", "8", ":"),
    "pose-regression": Style("", "#7570B3", "h", ":"),
    "handles": Style("Handles", "#CC6677", "p", "--"),
    "supervised": Style("", "#E69F00", "s", (0.0, (6.0, 1.5))),
    "snug": Style("", "#0072B2", "o"),
    "snug-paper": Style("", "#94A000", "o", "-."),
    "snug-dynamic": Style("", "#CC3311", "o"),
    "snug-shapes": Style("", "#EE3377", "o", ":"),
    "newton": Style("Newton", "#D55E00", "P"),
    "lbfgs": Style("L-BFGS", "#CC79A7", "X"),
    "fast-lbfgs": Style("Fast L-BFGS", "#BB5566", "X", "--"),
    "gradient-descent": Style("Gradient descent", "#7A5C00", "p"),
    "vbd": Style("Vertex block descent", "#44AA99", ">"),
    "xpbd": Style("XPBD", "#332288", "<"),
    "simulation-tolerance": Style("Simulation to a tolerance", "#555555", "*"),
    "simulation-dt": Style("Simulation with smaller steps", "#882255", "*"),
    # Solvers that start from another method have the colour of that method.
    "snug+lbfgs": Style("SNUG + L-BFGS", "", "X", "-."),
    "snug+fast-lbfgs": Style("SNUG + fast L-BFGS", "", "X", "--"),
    "snug+newton": Style("SNUG + Newton", "", "P", "-."),
    "snug-dynamic+lbfgs": Style("SNUG, dynamic + L-BFGS", "", "X", "-."),
    "snug-dynamic+fast-lbfgs": Style("SNUG, dynamic + fast L-BFGS", "", "X", "--"),
    "skinning+lbfgs": Style("Skinning + L-BFGS", "", "X", "-."),
    # So has the least that a network's own space allows.
    "handles-floor": Style("Floor of handles", "", "p", ":"),
    # So have networks that learn from more or fewer frames.
    "snug-data": Style("SNUG", "", "o"),
    "pbns-data": Style("PBNS", "", "^", "-."),
    "supervised-data": Style("Supervised", "", "s", (0.0, (6.0, 1.5))),
    "santesteban2019-data": Style("Santesteban 2019", "", "d", (0.0, (1.0, 1.0))),
    "tailornet-data": Style("TailorNet", "", "H", ":"),
    "nearest-poses-data": Style("Nearest poses", "", "8", ":"),
    "pose-regression-data": Style("Ridge on principal components", "", "h", ":"),
}
# Roles that a figure shows when it has no room for all; external: roll-outs of the user.
LEADING = ("reference", "baseline", "network", "external")
ROOM = 8  # methods that a figure shows whatever they are
LINES = 5  # methods whose curves a panel holds
# Members of a family share its colour. Iterations go by doubling: four in a row have four lines.
_DASHES: tuple[Line, ...] = ((0.0, (8.0, 1.5)), "--", "-.", ":")
_SPARE = ("#999933", "#661100", "#AA4499", "#117733", "#88CCEE", "#DDCC77")
_SPARE_MARKERS = ("h", "8", "d", "v", "p")


def family_style(run: Run, method: ReportedMethod) -> Style:
    """Return the style of a method's family; an unknown one has a spare colour that depends on its name.

    A method that starts from another has the colour of that one, whether it ran or not; an ablation has the
    marker of its base.
    """
    name = method.family
    label = name if method.level is not None else method.label
    number = zlib.crc32(name.encode())
    spare = Style(label, _SPARE[number % len(_SPARE)], _SPARE_MARKERS[number % len(_SPARE_MARKERS)])
    known = KNOWN.get(name)
    if known and known.colour:
        return replace(known, label=known.label or label)
    base = run.methods.get(method.base)
    if base is method:
        return spare
    above = family_style(run, base) if base else KNOWN.get(method.base)
    if above is None:
        return spare
    if method.role == "ablation" and known is None:
        return replace(spare, marker=above.marker, line=":")
    drawn = known or replace(spare, line=":")
    return replace(drawn, colour=above.colour, label=drawn.label or label)


def style(run: Run, method: str) -> Style:
    """Return the style of one method, with its own label and, in a family, its own line."""
    declared = run.methods[method]
    plain = replace(family_style(run, declared), label=declared.label)
    if declared.level is None or declared.level < 1.0:
        return plain
    return replace(plain, line=_DASHES[int(declared.level).bit_length() % len(_DASHES)])


def leading(run: Run, methods: Iterable[str]) -> list[str]:
    """Return the methods in order; those of leading roles alone where a figure has no room for all.

    Perturbed references, which only show the reference's uncertainty, are left out.
    """
    ordered = run.ordered(set(methods) - set(run.reference_ensemble))
    return ordered if len(ordered) <= ROOM else [m for m in ordered if run.methods[m].role in LEADING]


def few(run: Run, methods: Iterable[str]) -> list[str]:
    """Return at most LINES methods, in order: those that cross in one panel.

    Reference, roll-outs of the user and the first baseline come first, then trained networks.
    """
    shown = leading(run, methods)
    baseline = next((m for m in shown if run.methods[m].role == "baseline"), "")

    def rank(name: str) -> int:
        method = run.methods[name]
        if method.role in ("reference", "external") or name == baseline:
            return 0
        return 1 if method.role == "network" and not method.base else 2

    return run.ordered(sorted(shown, key=rank)[:LINES])
