"""The experiments that reproduce the paper's figures, by name."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from experiments import chain, formation, horizon, hover, preview, swapping, turning
from experiments.runner import Options, Result, Tell


@dataclass(frozen=True)
class Experiment:
    """One row of the table.

    Attributes
    ----------
    name, title
        For the command line.
    flights
        How many seeds it takes where none are given.
    run
        Runs it.
    """

    name: str
    title: str
    flights: int
    run: Callable[[Options, Tell], Result]


EXPERIMENTS: Final = MappingProxyType(
    {
        row.name: row
        for row in (
            Experiment("hover", "Fig. 1: hovering errors of [11], the paper and the cascade", 3, hover.run),
            Experiment(
                "horizon", "Fig. 2: computing time and tracking error against the horizon", 3, horizon.run
            ),
            Experiment(
                "formation", "Fig. 3: formation errors of every scheme over five minutes", 5, formation.run
            ),
            Experiment("preview", "A figure-eight with and without preview and feed-forward", 3, preview.run),
            Experiment("chain", "Errors along chains, trees and with several leaders", 3, chain.run),
            Experiment("turning", "Yaw steps of a leader whose followers turn with it", 3, turning.run),
            Experiment("swapping", "Ten vehicles swap places without collision", 5, swapping.run),
        )
    }
)
"""Every experiment by name."""


def save_figure(result: Result, path: Path) -> None:
    """Draw a result into a file.

    Parameters
    ----------
    result
        What an experiment returned.
    path
        File; its ending chooses the format (png, svg, pdf).

    Raises
    ------
    ImportError
        matplotlib is not installed.
    ValueError
        An ending that matplotlib does not know.
    OSError
        The file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # Fixed identifiers keep a figure under version control the same as long as its data are.
    mpl.rcParams["svg.hashsalt"] = "rcopterx"
    figure = Figure()
    FigureCanvasAgg(figure)
    result.draw(figure)
    figure.savefig(path, dpi=110, metadata={"Date": None} if path.suffix == ".svg" else None)
