"""Commands that installed packages add, by the entry-point group `rcopterx.commands`.

An entry point names a `typer.Typer` of one command or of a group; `flights` and `identify` name modules with
what `flights --check`, `flights --digest`, `identify --from FILE.csv`, `replay --agent` and
`replay --transmitter` do.
"""

from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

import typer
from typer.core import TyperCommand

from rcopterx.commands.fleet_option import EXIT_USAGE, failure
from rcopterx.user_text import described

GROUP: Final = "rcopterx.commands"
STUDIES: Final = (
    "amplification", "arena", "bench", "experiment", "faults", "import", "import-skybrush",
    "inject", "new-plugin", "replay-tracker", "search",
)  # fmt: skip
"""Commands of `rcopterx-studies`, which need not be installed to fly."""


def added_commands() -> dict[str, EntryPoint]:
    """Entry points of installed packages by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def added(name: str, words: str) -> Any:
    """Import what an entry point names; without it end with the package that has the command `words`."""
    if (point := added_commands().get(name)) is None:
        where = "part of rcopterx-studies: pip install rcopterx-studies"
        raise failure(f"rcopterx {words}: {where}", code=EXIT_USAGE)
    try:
        return point.load()
    except Exception as error:  # a package may raise anything
        raise failure(f"rcopterx {words} ({point.value}) cannot be imported: {described(error)}") from error


def added_command(name: str) -> Any:
    """Import a command; one that cannot be imported fails when it is run, not in the list of commands."""
    try:
        found: Any = typer.main.get_command(added(name, name))
    except typer.Exit as ended:
        if name not in added_commands():
            raise
        code = ended.exit_code

        def run() -> None:
            raise typer.Exit(code)

        found = TyperCommand(name, callback=run, help="Cannot be imported.")
    found.name = name
    return found
