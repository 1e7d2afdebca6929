"""Drawing figures with `matplotlib`, which only figures import."""

from collections.abc import Callable
from pathlib import Path
from typing import Any


def save_figure(draw: Callable[[Any], None], path: Path) -> None:
    """Draw a figure into a file, whose ending chooses the format (png, svg, pdf).

    Raises `ImportError`: matplotlib is not installed. Raises `ValueError`: an ending that matplotlib does not
    know. Raises `OSError`: the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Fixed identifiers keep a figure under version control the same as long as its data are.
    mpl.rcParams["svg.hashsalt"] = "rcopterx"
    figure = Figure()
    draw(figure)
    figure.savefig(path, dpi=110, metadata={"Date": None} if path.suffix == ".svg" else None)
