"""How each method is named and drawn: the same label, colour and marker in every table and figure.

Colours are those of Okabe and Ito (2008), told apart under every common colour-vision deficiency;
the marker repeats what the colour says, for print in grey.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

REFERENCE = "simulation"
MOVED = "simulation-moved"  # the same from a start moved by a nanometre: the floor of distances
NETWORKS = ("snug", "pbns", "supervised")
STATUS_COLOURS = {
    "ok": "#0072B2",
    "stalled": "#E69F00",
    "timeout": "#CC79A7",
    "diverged": "#D55E00",
    "failed": "#8B2C00",
    "skipped": "#B8B8B8",
}


Line = str | tuple[float, tuple[float, ...]]  # matplotlib's: a name, or an offset and the dashes [points]


@dataclass(frozen=True)
class Style:
    """Label for people, colour, matplotlib marker and line of one method."""

    label: str
    colour: str
    marker: str
    line: Line = "-"


_KNOWN = {
    "simulation": Style("Simulation", "#000000", "*"),
    MOVED: Style("Simulation, start moved", "#444444", "x", "--"),
    "free-bound": Style("Free lower bound", "#5D3A9B", "_", "--"),
    "skinning": Style("Skinning alone", "#8C8C8C", "D", "--"),
    "untrained": Style("SNUG, untrained", "#56B4E9", "v", "--"),
    "pbns": Style("PBNS", "#009E73", "^"),
    "pbns-springs": Style("PBNS, springs", "#117733", "^", ":"),
    "tailornet": Style("TailorNet", "#661100", "H"),
    "santesteban2019": Style("Santesteban 2019", "#AA4499", "d"),
    "supervised": Style("Supervised", "#E69F00", "s"),
    "snug": Style("SNUG", "#0072B2", "o"),
    "snug-paper": Style("SNUG, paper's text", "#94A000", "o", "-."),
    "snug-dynamic": Style("SNUG, dynamic", "#CC3311", "o"),
}
# What a figure shows that has no room for all: the rest is in the tables.
LEADING = (
    "simulation", "skinning", "pbns", "tailornet", "santesteban2019", "supervised", "snug", "snug-paper",
    "snug-dynamic",
)  # fmt: skip
ROOM = 8  # methods that a figure shows whatever they are
_VARIANT = "snug-"  # of SNUG: a recipe of its own, drawn in a spare colour with SNUG's marker
_FAMILIES = {
    "newton": Style("Newton", "#D55E00", "P"),
    "lbfgs": Style("L-BFGS", "#CC79A7", "X"),
    "gradient-descent": Style("Gradient descent", "#7A5C00", "p"),
    "vbd": Style("Vertex block descent", "#44AA99", ">"),
    "xpbd": Style("XPBD", "#332288", "<"),
    "simulation-tolerance": Style("Simulation to a tolerance", "#555555", "*"),
    "simulation-dt": Style("Simulation with smaller steps", "#882255", "*"),
}
# Members of a family share its colour. Cuts go by doubling: four in a row have four lines.
_DASHES: tuple[Line, ...] = ((0.0, (8.0, 1.5)), "--", "-.", ":")
_SPARE = ("#999933", "#661100", "#AA4499", "#117733", "#88CCEE", "#DDCC77")
# Nothing of these is random, nor of a solver that starts from one of them; nor are solvers cut short.
_UNSEEDED = (REFERENCE, MOVED, "skinning", "free-bound", "newton-vbd", "newton-xpbd")
CLEANED = "+cleanup"  # at the end of a method's name: its vertices were pushed out of the body afterwards


@dataclass(frozen=True)
class Cut:
    """A member of a family of methods that differ by one number: which family, its place, and its mark."""

    family: str
    order: float
    mark: str


def cut_of(method: str) -> Cut | None:
    """("newton", 4, "4") for "newton-4"; None for a method that belongs to no family."""
    if match := re.fullmatch(r"simulation-1e-(\d+)", method):
        return Cut("simulation-tolerance", float(match[1]), f"1e-{match[1]}")
    if match := re.fullmatch(r"simulation-dt/(\d+)", method):
        return Cut("simulation-dt", float(match[1]), f"dt/{match[1]}")
    match = re.fullmatch(r"(.+)-(\d+)", method)
    return Cut(match[1], float(match[2]), match[2]) if match else None


def is_hybrid(method: str) -> bool:
    """Whether it is a solver that starts each step from another method's guess, as "snug+lbfgs-4"."""
    start, plus, solver = method.partition("+")
    cut = cut_of(solver)
    return bool(start and plus and cut and cut.family in _FAMILIES)


def is_contestant(method: str) -> bool:
    """Whether it runs garments: not the reference, its twins, nor the bound."""
    return method.partition("-")[0] != REFERENCE and method != "free-bound"


def kin_of(method: str) -> str:
    """A name that SNUG shares with its variants and with what is made of them: with equal seeds they begin
    with the same weights and draw the same windows. Empty where no seed changes anything.
    """
    start = method.partition("+")[0]
    if not is_seeded(method):
        return ""
    return "snug" if start.startswith(_VARIANT) else start


def is_seeded(method: str) -> bool:
    """Whether what it gives depends on the seed of the run: a network, or what starts from one."""
    start = method.partition("+")[0]
    return start not in _UNSEEDED and cut_of(start) is None


def family_style(name: str) -> Style:
    """The style of a family: a hybrid has the colour of what it starts from and the marker of its solver."""
    start, plus, solver = name.partition("+")
    if plus and solver in _FAMILIES:
        before, after = style(start), _FAMILIES[solver]
        return Style(f"{before.label} + {after.label}", before.colour, after.marker, "-.")
    spare = _SPARE[zlib.crc32(name.encode()) % len(_SPARE)]
    return _FAMILIES.get(name, Style(name, spare, "h"))


def style(method: str) -> Style:
    """The style of a method; a name not known here gets a spare colour that depends on the name alone."""
    if method in _KNOWN:
        return _KNOWN[method]
    if method.endswith(CLEANED):
        base = style(method.removesuffix(CLEANED))
        return Style(f"{base.label}, cleaned up", base.colour, "p", ":")
    if method.startswith(_VARIANT) and "+" not in method:
        base = family_style(method)
        words = re.sub(r"^window(\d+)$", r"windows of \1", method.removeprefix(_VARIANT)).replace("-", " ")
        return Style(f"SNUG, {words}", base.colour, "o", ":")
    cut = cut_of(method)
    if cut is None:
        return family_style(method)
    base = family_style(cut.family)
    if cut.family == "simulation-tolerance":
        return Style(f"Simulation to {cut.mark}", base.colour, base.marker)
    if cut.family == "simulation-dt":
        return Style(f"Simulation, step {cut.mark}", base.colour, base.marker)
    steps = "iteration" if cut.mark == "1" else "iterations"
    dashes = _DASHES[int(cut.order).bit_length() % len(_DASHES)]
    return Style(f"{base.label}, {cut.mark} {steps}", base.colour, base.marker, dashes)


def label(method: str) -> str:
    return style(method).label


def ordered(methods: Iterable[str]) -> list[str]:
    """Without repeats: the known methods first, then solvers by family and place in it, then the rest."""
    known, families = list(_KNOWN), list(_FAMILIES)

    def rank(method: str) -> tuple[int, int, str, float]:
        if method in known:
            return (0, known.index(method), "", 0.0)
        cut = cut_of(method)
        family, place = (cut.family, cut.order) if cut else (method, 0.0)
        if family in families:
            return (1, families.index(family), family, place)
        return (2 + ("+" not in family), 0, family, place)

    return sorted(set(methods), key=rank)


def leading(methods: Iterable[str]) -> list[str]:
    """In order; those of `LEADING` alone where there are more than a figure has room for."""
    found = ordered(methods)
    return found if len(found) <= ROOM else [method for method in found if method in LEADING]
