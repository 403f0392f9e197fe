"""Figures of a run, each a class in a file of its own.

A new figure is such a file, a line in FIGURES and its place in reports.blocks.BLOCKS.
"""

from reports.figures.break_even import BreakEven
from reports.figures.dots import Dots
from reports.figures.energy_series import EnergySeries
from reports.figures.error_against_time import ErrorOfPageOne, ErrorsOfScene, ErrorsOfScenes
from reports.figures.fabric.textile_errors import TextileErrors
from reports.figures.figure import Figure
from reports.figures.hem import Hem
from reports.figures.histograms import Histograms
from reports.figures.known_answers import KnownAnswers
from reports.figures.stability_maps import StabilityMaps
from reports.figures.training_curves import TrainingCurves

FIGURES: tuple[Figure, ...] = (
    ErrorOfPageOne(),
    ErrorsOfScene(),
    ErrorsOfScenes(),
    BreakEven(),
    Dots(),
    Histograms(),
    Hem(),
    EnergySeries(),
    TextileErrors(),
    KnownAnswers(),
    StabilityMaps(),
    TrainingCurves(),
)
