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
NETWORKS = ("snug", "pbns", "supervised")
STATUS_COLOURS = {
    "ok": "#0072B2",
    "stalled": "#E69F00",
    "timeout": "#CC79A7",
    "diverged": "#D55E00",
    "failed": "#8B2C00",
    "skipped": "#B8B8B8",
}


@dataclass(frozen=True)
class Style:
    """Label for people, colour, matplotlib marker and line of one method."""

    label: str
    colour: str
    marker: str
    line: str = "-"


_KNOWN = {
    "simulation": Style("Simulation", "#000000", "*"),
    "skinning": Style("Skinning alone", "#8C8C8C", "D", "--"),
    "untrained": Style("SNUG, untrained", "#56B4E9", "v", "--"),
    "pbns": Style("PBNS", "#009E73", "^"),
    "supervised": Style("Supervised", "#E69F00", "s"),
    "snug": Style("SNUG", "#0072B2", "o"),
}
_FAMILIES = {
    "newton": Style("Newton", "#D55E00", "P"),
    "lbfgs": Style("L-BFGS", "#CC79A7", "X"),
}
_SPARE = ("#7A5C00", "#332288", "#882255", "#44AA99", "#999933", "#661100")


def family_of(method: str) -> tuple[str, int] | None:
    """("newton", 4) for "newton-4", a solver cut at 4 iterations; None for a method that is no such cut."""
    match = re.fullmatch(r"(.+)-(\d+)", method)
    return (match[1], int(match[2])) if match else None


def style(method: str) -> Style:
    """The style of a method; a name not known here gets a spare colour that depends on the name alone."""
    if method in _KNOWN:
        return _KNOWN[method]
    cut = family_of(method)
    name = cut[0] if cut else method
    colour = _SPARE[zlib.crc32(name.encode()) % len(_SPARE)]
    base = _FAMILIES.get(name, Style(name, colour, "h"))
    if not cut:
        return base
    steps = "iteration" if cut[1] == 1 else "iterations"
    return Style(f"{base.label}, {cut[1]} {steps}", base.colour, base.marker)


def label(method: str) -> str:
    return style(method).label


def ordered(methods: Iterable[str]) -> list[str]:
    """Without repeats: the known methods first, then solvers by family and iterations, then the rest."""
    known = list(_KNOWN)

    def rank(method: str) -> tuple[int, str, int]:
        if method in known:
            return (known.index(method), "", 0)
        family, cut = family_of(method) or (method, 0)
        return (len(known) + (family not in _FAMILIES), family, cut)

    return sorted(set(methods), key=rank)
