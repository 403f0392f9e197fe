"""The list of report blocks: headings, sentences, figures and tables in the order in which they are read.

The PDF (reports.document) and the page (reports.page) walk the same BLOCKS. A block without content is left
out, and so is a heading with nothing below it. Blocks before the first heading make page one.
"""

from reports.blocks.block import Block, FigureBlock, Heading, SentenceBlock, TableBlock, TablesOfSuite
from reports.blocks.page_one_sentences import headline
from reports.blocks.printed_tables import failed_checks, not_converged, with_labels
from reports.blocks.what_went_wrong import unread_files, worst

BLOCKS: tuple[Block, ...] = (
    SentenceBlock(headline),
    FigureBlock("lead"),
    FigureBlock("error_against_time"),
    TableBlock("overview"),
    TableBlock("reference_uncertainty"),
    SentenceBlock(worst, small=True),
    Heading("The paper's tables"),
    TableBlock("energies"),
    TableBlock("curvature"),
    TableBlock("cost"),
    Heading("Findings"),
    TableBlock("relative_excess"),
    TableBlock("errors_in_spreads"),
    TableBlock("findings", most=40),
    TableBlock("ablation_effects"),
    Heading("Equal data"),
    TableBlock("equal_data", most=60),
    Heading("Error against run time"),
    FigureBlock("error_against_time_of_scene"),
    FigureBlock("error_against_time_scenes"),
    TableBlock("error_rivals"),
    FigureBlock("break_even", "against_vertices"),
    TableBlock("crossings"),
    Heading("Garments in motion"),
    FigureBlock("frames"),
    FigureBlock("strip"),
    FigureBlock("map"),
    FigureBlock("failures"),
    Heading("Behind the means"),
    FigureBlock("dots"),
    FigureBlock("histograms"),
    Heading("Dynamics"),
    TableBlock("dynamics"),
    FigureBlock("hem"),
    FigureBlock("energy_series"),
    Heading("Body shapes"),
    TableBlock("shapes"),
    Heading("Validation"),
    FigureBlock("known_answers"),
    TableBlock("validation", printed=failed_checks),
    Heading("Stress"),
    FigureBlock("stability_maps"),
    TableBlock("extremes", printed=not_converged),
    Heading("Training"),
    TableBlock("trainings"),
    FigureBlock("training"),
    TablesOfSuite("performance"),
    Heading("How cells, checks and stress tests ended"),
    TableBlock("endings"),
    TableBlock("unfinished", printed=with_labels),
    SentenceBlock(unread_files),
    FigureBlock("spare_strip", fills_last_page=True),
)
