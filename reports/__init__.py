"""Reports of finished runs: tables, figures, PDF and page; commands that compare, check and film.

Each of these imports only those before it: finished_run, statistics, tables, figures, pictures, blocks
(the one list of what a report shows), sentences, pdf and page.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
