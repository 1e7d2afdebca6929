"""Hook of the documentation site: search ranks pages for users above those for developers."""

from typing import Any

SECTIONS = {"Start": 2.0, "How to": 2.0, "Reference": 1.5}
"""Factors of the rank by the first heading above a page in the navigation."""
DECISIONS = 0.3


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Set the factor of the page, which the theme's search reads."""
    ancestors = [section.title for section in page.ancestors]
    factor = SECTIONS.get(ancestors[-1], 1.0) if ancestors else 1.0
    if page.file.src_uri.startswith("decisions/"):
        factor = DECISIONS
    page.meta.setdefault("search", {})["boost"] = factor
    return markdown
