"""The list of report blocks: headings, sentences, figures and tables in the order in which they are read.

The PDF (reports.pdf) and the page (reports.page) walk the same BLOCKS. A block without content is left
out, and so is a heading with nothing below it. Blocks before the first heading make page one.
A new figure is a function in a file of its own and a line here.
"""

from reports.blocks.block import Block, Heading, SentenceBlock, TableBlock
from reports.blocks.printed_tables import failed_checks, not_converged, with_labels
from reports.blocks.sentences import headline, unread_files, worst
from reports.figures.costs import break_even, error_of_page_one
from reports.figures.figure import Figure
from reports.figures.over_time import energy_series, training_curves
from reports.figures.values import dots, known_answers
from reports.pictures import failures, lead_row, side_by_side

BLOCKS: tuple[Block, ...] = (
    SentenceBlock(headline),
    Figure("lead", lead_row),
    Figure("error_against_time", error_of_page_one),
    TableBlock("overview"),
    TableBlock("reference_uncertainty"),
    SentenceBlock(worst, small=True),
    Heading("The paper's tables"),
    TableBlock("energies"),
    TableBlock("paper_table_1"),
    TableBlock("curvature"),
    TableBlock("cost"),
    Heading("Findings"),
    TableBlock("relative_excess"),
    TableBlock("errors_in_spreads"),
    TableBlock("findings", most=40),
    TableBlock("ablation_effects"),
    Heading("Error against run time"),
    TableBlock("error_rivals"),
    Figure("break_even", break_even),
    Heading("Garments in motion"),
    Figure("frames", side_by_side, ("frames_*",)),
    Figure("failures", failures),
    Heading("Behind the means"),
    Figure("dots", dots),
    Heading("Dynamics"),
    TableBlock("dynamics"),
    Figure("energy_series", energy_series, ("energy_series_*",)),
    Heading("Body shapes"),
    TableBlock("shapes"),
    Heading("Validation"),
    Figure("known_answers", known_answers),
    TableBlock("validation", printed=failed_checks),
    Heading("Stress"),
    TableBlock("extremes", printed=not_converged),
    Heading("Training"),
    Figure("training", training_curves, ("training.*", "training_*")),
    Heading("How cells, checks and stress tests ended"),
    TableBlock("endings"),
    TableBlock("unfinished", printed=with_labels),
    SentenceBlock(unread_files, small=True),
)

FIGURES = tuple(block for block in BLOCKS if isinstance(block, Figure))
