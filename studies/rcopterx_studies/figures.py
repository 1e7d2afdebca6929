"""What all figures of studies have in common."""

from collections.abc import Callable
from io import StringIO
from typing import Any


def finish_figure(figure: Any, title: str | None = None, grid: str = "both") -> None:
    """Add grids and a title, and fit everything into the figure."""
    for axes in figure.axes:
        axes.grid(axis=grid, alpha=0.3)
    if title is not None:
        figure.suptitle(title)
    figure.tight_layout()


def svg_of(name: str, size: tuple[float, float], draw: Callable[[Any], None]) -> str:
    """Return a picture as an SVG element, `size` in inches; `draw` is called with an empty figure."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Text stays text; identifiers of elements depend on the name, so that a page can have many pictures.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.size": 8}):
        figure, text = Figure(figsize=size), StringIO()
        draw(figure)
        figure.savefig(text, format="svg", metadata={"Date": None}, bbox_inches="tight")
    return text.getvalue()[text.getvalue().index("<svg") :]
