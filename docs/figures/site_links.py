"""Hook of the documentation site: links to files outside of `docs` become their paths."""

import re
from typing import Any

OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./([^)]+)\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace `[words](../path)` by the words and the path in the repository."""
    return OUTSIDE.sub(r"\1 (`\2`)", markdown)
