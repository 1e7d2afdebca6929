"""Hook of the documentation site: formulas become MathML, which browsers show offline and without scripts.

Markdown would take the underscores of a formula for emphasis, so each is replaced by a mark meanwhile.
"""

import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r"(```.*?```|`[^`\n]*`)|\$\$(.+?)\$\$|\$([^$\n]+?)\$", re.DOTALL)
MARK = "formula{}here"
MARKED = re.compile(r"formula(\d+)here")

_formulas: list[str] = []


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace formulas between dollar signs by marks, except in code."""
    _formulas.clear()

    def marked(found: re.Match[str]) -> str:
        code, block, inline = found.groups()
        if code is not None:
            return str(code)
        _formulas.append(convert(block or inline, display="block" if block else "inline"))
        return MARK.format(len(_formulas) - 1)

    return FORMULA.sub(marked, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Put the formulas in place of the marks."""
    return MARKED.sub(lambda found: _formulas[int(found[1])], html)
