"""Parts of a document that are generated: between two comments, the first of which says from what.

<!-- generated: table overview of quick; method, relative_excess -->
...
<!-- end of generated -->
"""

from __future__ import annotations

import re
from collections.abc import Callable

BEGIN, END = "<!-- generated: {} -->", "<!-- end of generated -->"
_PART = re.compile(rf"({BEGIN.format('(.+?)')}\n)(.*?)({END})", re.S)


def fill(document: str, generate: Callable[[str], str]) -> str:
    r"""Return the document with each generated part made anew by `generate` from what its comment says.

    Raises:
        ValueError: for a part without an end.

    >>> text = "A\n<!-- generated: sum -->\n3\n<!-- end of generated -->\nB"
    >>> fill(text, lambda words: "4").splitlines()[2]
    '4'
    """
    if document.count("<!-- generated: ") != document.count(END):
        raise ValueError(f"each '<!-- generated: ... -->' needs an '{END}' below it")
    return _PART.sub(lambda part: f"{part[1]}{generate(part[2]).strip()}\n{part[4]}", document)
