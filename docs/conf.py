"""Configuration of the site: `sphinx-build -W docs reports/runs/site` makes it."""

import sys
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

project = "Neural garments versus a reference solver"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["notebook/*.py"]
suppress_warnings = ["toc.not_included"]  # the notebook is outside of the navigation
myst_heading_anchors = 4  # links to headings, as on the pages of the repository
napoleon_use_ivar = True  # attributes are described once, in the docstring of their class
autodoc_typehints = "description"
autodoc_member_order = "bysource"
html_theme = "furo"
html_show_copyright = False
html_title = "Neural garment benchmark"
html_static_path = ["_static"]
html_js_files = ["sort_tables.js"]
html_css_files = ["wide_tables.css"]


def setup(app: Sphinx) -> None:
    """Make the pages of the published runs before the sources are read."""
    from reports.text.run_page import write_run_pages

    app.connect("builder-inited", lambda _: write_run_pages(DOCS.parent / "reports/published", DOCS / "runs"))
