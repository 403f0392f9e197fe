"""Configuration of the site: `sphinx-build -W docs reports/runs/site` makes it."""

import json
import re
import sys
from pathlib import Path

from docutils.nodes import document
from myst_parser.parsers.sphinx_ import MystParser
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


class NotebookParser(MystParser):
    """Cells of a Jupyter notebook as a page: text as it is, code as blocks, each with its outputs."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: document) -> None:
        """Parse the cells as one text in Markdown."""
        page = []
        for cell in json.loads(inputstring)["cells"]:
            text = "".join(cell["source"])
            page.append(f"```python\n{text}\n```" if cell["cell_type"] == "code" else text)
            for output in cell.get("outputs", ()):
                if picture := output.get("data", {}).get("image/png"):
                    page.append(f"![Figure](data:image/png;base64,{''.join(picture.split())})")
                elif output.get("name") == "stdout":
                    page.append(f"```text\n{''.join(output['text']).rstrip()}\n```")
        super().parse("\n\n".join(page), document)


def write_study_pages(target: Path) -> None:
    """Write the README of each study of the repository as a page, with links that lead from there."""
    target.mkdir(exist_ok=True)
    for path in (DOCS.parent / "studies").glob("*/README.md"):
        text = path.read_text(encoding="utf-8").replace("](../../docs/", "](../")
        text = text.replace("](frozen/", f"](../../studies/{path.parent.name}/frozen/")
        (target / f"{path.parent.name}.md").write_text(text, encoding="utf-8", newline="\n")


def setup(app: Sphinx) -> None:
    """Make the pages of studies before the sources are read; read notebooks too."""

    def lead_to_study_pages(_: Sphinx, __: str, source: list[str]) -> None:
        source[0] = re.sub(r"\]\((?:\.\./)+studies/(\w+)/README\.md", r"](/studies/\1.md", source[0])

    app.connect("builder-inited", lambda _: write_study_pages(DOCS / "studies"))
    app.connect("source-read", lead_to_study_pages)
    app.add_source_suffix(".ipynb", "notebook")
    app.add_source_parser(NotebookParser)
