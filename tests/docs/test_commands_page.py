"""Promises of the page of all commands: it has every command with every option, as in their help."""

import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest
import typer

from rcopterx.command_line import app

TEXT = (Path(__file__).parents[2] / "docs" / "commands.md").read_text(encoding="utf-8")
PARTS = re.split(r"\n#{2,3} `rcopterx ([\w -]+)`\n", TEXT)
SECTIONS = dict(zip(PARTS[1::2], PARTS[2::2], strict=True))
RENEW = "renew docs/commands.md, see CONTRIBUTING.md"


def commands() -> dict[str, Any]:
    """All commands and groups by name."""
    found: dict[str, Any] = {}
    group: Any = typer.main.get_command(app)
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        inner = getattr(command, "commands", {})
        found |= {name: command} | {f"{name} {key}": value for key, value in inner.items()}
    return found


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", unescape(text)).strip()


def test_the_page_has_every_command_and_no_other() -> None:
    assert sorted(SECTIONS) == sorted(commands()), RENEW


@pytest.mark.parametrize("name", commands())
def test_a_command_is_described_with_all_that_it_takes(name: str) -> None:
    command, section = commands()[name], SECTIONS[name]
    assert plain(command.help.split("\n\n")[0]) in plain(section), RENEW
    parameters = [one for one in command.params if one.name != "help"]
    for one in parameters:
        assert plain(getattr(one, "help", None) or "") in plain(section), RENEW
        if one.param_type_name == "option":
            assert all(spelt in section for spelt in (*one.opts, *one.secondary_opts)), RENEW
    rows = [line for line in section.partition("**Commands**")[0].splitlines() if line.startswith("* `")]
    assert len(rows) == len(parameters) + 1, RENEW
