"""Reports of finished runs: tables, figures, PDF and page; commands that compare, check, film and export.

Rooms, each importing only those before it: run (reading), statistics, tables, figures, pictures, blocks (the
one list of what a report shows), document (PDF) and page (HTML). A new figure is a class in a file of its own
and a line in reports.figures.FIGURES, a new table of means a Pivot in reports.tables.TABLES; a line in
reports.blocks.BLOCKS gives it a place.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
