"""What every part is told, and what all of them dress."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..wardrobe import embedded_motions

if TYPE_CHECKING:
    from snug.dressed_body import DressedBody
    from snug.motion import Motion

VALIDATION = "lunge"  # the training motion that part convergence holds out


@dataclass(frozen=True, kw_only=True)
class Settings:
    """device: cpu or cuda, where networks train. repeats: blocks of steps, or roll-outs. steps: of part
    convergence. folder: for its curve, its model and its checkpoints.
    """

    device: str
    repeats: int
    steps: int
    folder: Path


def training_motions() -> list[Motion]:
    """All motions that networks may learn from, whole."""
    from snug.motion_library import TRAIN

    return embedded_motions(TRAIN)


def kind_and_vertices(case: str) -> tuple[str, int]:
    """The two words of a case, as "snug, 4400"."""
    kind, vertices = case.split(", ")
    return kind, int(vertices)


def dressed_body(vertices: int) -> DressedBody:
    """The body in a T-shirt of about so many vertices."""
    from snug.body import Body
    from snug.dressed_body import DressedBody
    from snug.garments import find_template

    body = Body.load()
    return DressedBody(body, find_template("tshirt").tailor(body, vertices=vertices))
