"""Reports of finished runs: tables, figures, PDF and page; commands that compare, check and film.

Rooms, each importing only those before it: run (reading), statistics, tables, figures, pictures, blocks (the
one list of what a report shows), document (PDF) and page (HTML). A new figure is a function in a file of its
own and a Figure in reports.blocks.BLOCKS, a new table of means a Pivot in reports.tables.TABLES and a
TableBlock in BLOCKS.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
