"""Garment and motions of all microbenchmarks of networks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.assets.assets import embedded_motions

if TYPE_CHECKING:
    from snug.motion.motion import Motion
    from snug.networks.dressed_body import DressedBody


def training_motions() -> list[Motion]:
    """Return all motions that networks may learn from, whole."""
    from snug.motion.library import TRAIN

    return embedded_motions(TRAIN)


def dressed_body(vertices: int) -> DressedBody:
    """Return the body in a T-shirt of about so many vertices."""
    from snug.body.parametric_body import Body
    from snug.garments.templates import TSHIRT, find_template
    from snug.networks.dressed_body import DressedBody

    body = Body.load()
    return DressedBody(body, find_template(TSHIRT).tailor(body, vertices=vertices))
