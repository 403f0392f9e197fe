"""Garment and motions of all microbenchmarks of networks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.assets.assets import embedded_motions
from snug.body.parametric_body import Body
from snug.garments.templates import TSHIRT, find_template
from snug.motion.library import TRAIN
from snug.networks.dressed_body import DressedBody

if TYPE_CHECKING:
    from snug.motion.motion import Motion


def training_motions() -> list[Motion]:
    """Return all motions that networks may learn from, whole."""
    return embedded_motions(TRAIN)


def dressed_body(vertices: int) -> DressedBody:
    """Return the body in a T-shirt of about so many vertices."""
    body = Body.load()
    return DressedBody(body, find_template(TSHIRT).tailor(body, vertices=vertices))
