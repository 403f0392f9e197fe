"""Pictures of garments in a report: renderings of roll-outs, each kind a class in a file of its own.

A new picture is such a file, a line in PICTURES and its place in reports.blocks.BLOCKS.
"""

from reports.figures.figure import Figure
from reports.pictures.colour_maps import ColourMaps
from reports.pictures.failures import Failures
from reports.pictures.lead_row import LeadRow
from reports.pictures.side_by_side import SideBySide
from reports.pictures.strip import Strip

PICTURES: tuple[Figure, ...] = (
    LeadRow(),
    ColourMaps(),
    SideBySide(),
    Strip(),
    Failures(),
)
