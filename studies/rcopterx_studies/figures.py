"""What all figures of studies have in common."""

from typing import Any


def finish_figure(figure: Any, title: str | None = None, grid: str = "both") -> None:
    """Add grids and a title, and fit everything into the figure."""
    for axes in figure.axes:
        axes.grid(axis=grid, alpha=0.3)
    if title is not None:
        figure.suptitle(title)
    figure.tight_layout()
