"""The table of manoeuvres and their checks: acceptance test, demonstration and `rcopterx fly NAME`."""

from types import MappingProxyType, ModuleType
from typing import Any, Final

from rcopterx.ground_station.acceptance import checks, steps
from rcopterx.ground_station.acceptance.checks import Check
from rcopterx.ground_station.acceptance.flight import Manoeuvre
from rcopterx.tables import table_beside


def _manoeuvre(name: str, row: dict[str, Any]) -> Manoeuvre:
    fly = steps.in_order(*(_made(steps, words) for words in row.pop("steps")))
    wanted: list[Check] = []
    for words in row.pop("checks"):
        made = getattr(checks, words) if isinstance(words, str) else _made(checks, words)
        wanted += [made] if isinstance(made, Check) else made
    return Manoeuvre(name, fly=fly, checks=tuple(wanted), **row)


def _made(module: ModuleType, words: list[Any]) -> Any:
    """Call the function of a module that a row names, with the arguments and options behind the name."""
    name, *arguments = words
    options = arguments.pop() if arguments and isinstance(arguments[-1], dict) else {}
    return getattr(module, name)(*map(_frozen, arguments), **{k: _frozen(v) for k, v in options.items()})


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


_TABLE: Final = table_beside(__file__, "manoeuvres")
MANOEUVRES: Final = MappingProxyType({name: _manoeuvre(name, row) for name, row in _TABLE.items()})
