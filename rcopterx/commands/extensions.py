"""Commands that installed packages add, by the entry-point group `rcopterx.commands`.

An entry point names a `typer.Typer` of one command or of a group. That named `fly` is a module instead, with
what `fly --faults` and `fly chaos` do.
"""

from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from rcopterx.commands.fleet_option import EXIT_USAGE, failure

GROUP: Final = "rcopterx.commands"
STUDIES: Final = ("arena", "bench", "experiment", "fly --faults")
"""Commands of `rcopterx-studies`, which need not be installed to fly."""


def added_commands() -> dict[str, EntryPoint]:
    """Entry points of installed packages by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def added(name: str, command: str) -> Any:
    """Import what an entry point names; without it end with the package that has the command."""
    point = added_commands().get(name)
    if point is None:
        raise failure(
            f"rcopterx {command}: part of rcopterx-studies: pip install rcopterx-studies", code=EXIT_USAGE
        )
    return point.load()
