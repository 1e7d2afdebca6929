"""Names, limits and help of options and arguments, which are data: `options.toml`."""

import tomllib
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Final

import typer

from rcopterx.commands import fleet_option

_OPTIONS: Final = tomllib.loads((files(__package__) / "options.toml").read_text("utf-8"))


@cache
def with_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Annotate the parameters of a command with their options and arguments, and return it."""
    of_module = _OPTIONS.get(command.__module__.rpartition(".")[2], {})
    for name, table in of_module.get(command.__name__, {}).items():
        settings = dict(_OPTIONS["shared"][table] if isinstance(table, str) else table)
        kind: Any = typer.Argument if settings.pop("argument", False) else typer.Option
        if completion := settings.pop("complete", None):
            settings["autocompletion"] = getattr(fleet_option, completion)
        option = kind(*settings.pop("names", ()), **settings)
        command.__annotations__[name] = Annotated[command.__annotations__[name], option]
    return command
