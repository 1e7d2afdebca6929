"""All commands of `rcopterx`; the fast path of `kill` is in `rcopterx.cli`."""

from collections import UserDict
from importlib import import_module
from typing import Annotated, Any, Final

import typer
from typer import Option
from typer.core import TyperGroup

from rcopterx.commands import fleet_option
from rcopterx.commands.extensions import STUDIES, added_command, added_commands
from rcopterx.commands.fleet_option import user_errors, with_options
from rcopterx.tables import table_beside

_PANELS: Final = table_beside(fleet_option.__file__, "commands")
WITH_COORDINATES: Final = ("goto", "zone")  # commands that do not check for unknown options: -0.5 is a number
PLACES: Final = {
    function.partition(".")[2].strip("_").replace("_", "-"): (panel, *function.split("."))
    for panel, functions in _PANELS.items()
    for function in functions
}
"""Panel, module and name in it of every command, by the name that is typed."""


class _Imported(UserDict[str, Any]):
    """Commands by name, which are imported when they or their help are wanted."""

    def __getitem__(self, name: str) -> Any:
        panel, module, function = self.data[name]
        command = getattr(import_module(f"rcopterx.commands.{module}"), function)
        if not isinstance(command, typer.Typer):
            single = typer.Typer(add_completion=False)
            single.command(context_settings={"ignore_unknown_options": name in WITH_COORDINATES})(command)
            command = single
        for one in command.registered_commands:
            with_options(one.callback)
        found: Any = typer.main.get_command(command)
        found.name, found.rich_help_panel = name, panel
        return found


class Commands(TyperGroup):
    """All commands; errors that users can correct end them with a line instead of a traceback.

    A command is imported when it or its help is wanted.
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _Imported(PLACES)

    def list_commands(self, ctx: Any) -> list[str]:
        """See `Group.list_commands`."""
        return list(dict.fromkeys([*super().list_commands(ctx), *added_commands()]))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """See `Group.get_command`."""
        found = super().get_command(ctx, cmd_name)
        if found is None and (cmd_name in STUDIES or cmd_name in added_commands()):
            found = added_command(cmd_name)
        return found

    def invoke(self, ctx: Any) -> Any:
        """See `Group.invoke`."""
        with user_errors():
            return super().invoke(ctx)


app = typer.Typer(
    name="rcopterx",
    cls=Commands,
    help="Formation flight of miniature helicopters with distributed model predictive control. "
    "Lengths are metres, times seconds, angles on the command line degrees.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
)


def _show_version(wanted: bool) -> None:
    if not wanted:
        return
    from rcopterx.flights.provenance import provenance

    origin = provenance()
    commit = f" (commit {origin['commit']})" if origin["commit"] else ""
    typer.echo(f"rcopterx {origin['rcopterx']}{commit}, Python {origin['python']}")
    raise typer.Exit


@app.callback()
def _common(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001 - its callback shows it
        bool, Option("--version", callback=_show_version, is_eager=True, help="Show version and commit.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        from rcopterx.commands.next_steps import show_next_steps

        show_next_steps()
