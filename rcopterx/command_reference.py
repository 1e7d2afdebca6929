"""Generates the page of all commands: `python -m rcopterx.command_reference > docs/commands.md`."""

import re
from typing import Any

import typer

from rcopterx.command_line import COMMANDS, app

HEAD = """\
# Commands

Generated from the commands by `python -m rcopterx.command_reference`; `--help` shows the same text in the
terminal. Lengths are metres, times seconds, angles on the command line degrees; in Python, in the fleet file
and on the bus they are radians.
"""


def reference() -> str:
    """The page, ending with a newline."""
    group: Any = typer.main.get_command(app)
    context = group.make_context("rcopterx", [], resilient_parsing=True)
    parts = [HEAD]
    for panel, functions in COMMANDS.items():
        parts.append(f"\n## {panel}\n")
        for function in functions:
            name = function.__name__.replace("_", "-")
            parts.append(_section(group.get_command(context, name), f"rcopterx {name}"))
    bench = group.get_command(context, "bench")
    parts.append("\n## Benchmarks\n")
    for name in bench.list_commands(context):
        parts.append(_section(bench.get_command(context, name), f"rcopterx bench {name}"))
    return "".join(parts)


def _section(command: Any, name: str) -> str:
    """Heading, description, and a table of arguments and options."""
    arguments = [one for one in command.params if one.param_type_name == "argument"]
    options = [one for one in command.params if one.param_type_name == "option" and one.name != "help"]
    words = "".join(f" {_metavar(one)}" for one in arguments)
    usage = f"{name}{words}{' [OPTIONS]' if options else ''}"
    text = f"\n### {name.removeprefix('rcopterx ')}\n\n```text\n{usage}\n```\n"
    text += f"\n{_paragraphs(command.help or '')}\n"
    if arguments or options:
        text += "\n| | | default |\n| --- | --- | --- |\n"
        text += "".join(_row(f"`{_metavar(one)}`", one) for one in arguments)
        text += "".join(_row(_names(one), one) for one in options)
    return text


def _row(names: str, parameter: Any) -> str:
    default = parameter.default
    shown = (
        "" if default in (None, False, (), "") or callable(default) or parameter.required else f"`{default}`"
    )
    return f"| {names} | {_cell(getattr(parameter, 'help', None) or '')} | {shown} |\n"


def _names(option: Any) -> str:
    spelt = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    takes = "" if option.is_flag else f" `{_metavar(option)}`"
    return _cell(spelt + takes)


def _metavar(parameter: Any) -> str:
    return str(parameter.metavar or parameter.name.upper())


def _cell(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|")


def _paragraphs(text: str) -> str:
    return "\n\n".join(re.sub(r"\s+", " ", part).strip() for part in text.split("\n\n"))


if __name__ == "__main__":
    print(reference(), end="")
