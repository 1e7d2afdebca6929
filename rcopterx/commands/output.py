"""What many commands print and draw: JSON documents, figures as text, tables, progress, pictures."""

import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from rcopterx.places import try_place

JsonOption = Annotated[bool, Option("--json", help="Print a JSON document.")]


def _checked_figure(path: Path | None) -> Path | None:
    """Refuse a figure that could not be written before anything is computed."""
    if path is None:
        return None
    if find_spec("matplotlib") is None:
        raise typer.BadParameter(
            "figures need matplotlib: pip install 'rcopterx[figures]'", param_hint="--plot"
        )
    if path.suffix not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(f"{path}: allowed endings are .png, .svg and .pdf", param_hint="--plot")
    try:
        try_place(path.absolute().parent)
    except OSError as error:
        raise typer.BadParameter(
            f"{path}: the directory cannot be written to: {error.strerror}", param_hint="--plot"
        ) from None
    return path


PlotOption = Annotated[
    Path | None,
    Option(metavar="FILE", callback=_checked_figure, help="Draw the figure into this file (png, svg, pdf)."),
]


def readable(document: object, indent: str = "") -> str:
    """Nested figures as indented lines; innermost tables use one line."""
    if not isinstance(document, dict):
        return f"{indent}{document}"
    lines = []
    for key, value in document.items():
        if isinstance(value, dict) and any(isinstance(inner, dict) for inner in value.values()):
            lines += [f"{indent}{key}", readable(value, indent + "  ")]
        elif isinstance(value, dict):
            lines.append(
                f"{indent}{key:26} " + "  ".join(f"{name} {number}" for name, number in value.items())
            )
        else:
            lines.append(f"{indent}{key:26} {value}")
    return "\n".join(lines)


def print_document(document: Any, as_json: bool, text: Callable[[Any], str] = readable) -> None:
    """Print a document as JSON, or as text for people."""
    typer.echo(json.dumps(document, indent=2) if as_json else text(document))


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table; texts are shown as they are."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    for heading in headings:
        table.add_column(Text(heading))
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table, highlight=False)


def print_changes(vehicle: str, lines: Sequence[str], say: Callable[[str], None] = typer.echo) -> None:
    """Print the changes of a fleet file."""
    for line in lines or ["nothing to change"]:
        say(f"{vehicle}: {line}")


class Progress:
    """Progress on standard error: a line for each step, and on a terminal a line that is rewritten."""

    def __init__(self, head: str) -> None:
        self._head = head
        self._started_s = time.monotonic()
        self._live = sys.stderr.isatty()
        self._shown = ""

    def say(self, text: str) -> None:
        """Print a step."""
        self._print(f"{self._elapsed_s():5.1f} s  {text}")

    def show(self, label: str, detail: str = "") -> None:
        """Show what is done now; without a terminal print each new label."""
        if self._live:
            self._print(f"{self._elapsed_s():.0f} s, {label}{detail}", nl=False)
        elif label != self._shown:
            self._shown = label
            self.say(label)

    def _elapsed_s(self) -> float:
        return time.monotonic() - self._started_s

    def _print(self, text: str, nl: bool = True) -> None:
        clear = "\r\x1b[K" if self._live else ""
        typer.echo(f"{clear}{self._head}: {text}", err=True, nl=nl)


def write_plot(draw: Callable[[Any], None], path: Path | None) -> None:
    """Draw a figure into a file, if one is named, whose ending chooses the format (png, svg, pdf)."""
    if path is None:
        return
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Fixed identifiers keep a figure under version control the same as long as its data are.
    mpl.rcParams["svg.hashsalt"] = "rcopterx"
    figure = Figure()
    draw(figure)
    figure.savefig(path, dpi=110, metadata={"Date": None} if path.suffix == ".svg" else None)
    typer.echo(f"figure: {path}", err=True)
