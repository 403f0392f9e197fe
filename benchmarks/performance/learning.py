"""What all measurements of networks dress, and in what motions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..assets import embedded_motions

if TYPE_CHECKING:
    from snug.dressed_body import DressedBody
    from snug.motion import Motion


def training_motions() -> list[Motion]:
    """All motions that networks may learn from, whole."""
    from snug.motion_library import TRAIN

    return embedded_motions(TRAIN)


def dressed_body(vertices: int) -> DressedBody:
    """The body in a T-shirt of about so many vertices."""
    from snug.body import Body
    from snug.dressed_body import DressedBody
    from snug.garment_kinds import TSHIRT, find_template

    body = Body.load()
    return DressedBody(body, find_template(TSHIRT).tailor(body, vertices=vertices))
