"""Promises of the page of all commands: it has every command with every option, as in their help."""

import re
from pathlib import Path
from typing import Any

import pytest
import typer

from rcopterx.command_line import app

TEXT = (Path(__file__).parents[1] / "docs" / "commands.md").read_text(encoding="utf-8")
SECTIONS = {part.partition("\n")[0]: part for part in TEXT.split("\n### ")[1:]}
RENEW = "run: python -m rcopterx.command_reference > docs/commands.md"


def commands() -> dict[str, Any]:
    """All commands by name; a group is left out for those in it."""
    found: dict[str, Any] = {}
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        inner = getattr(command, "commands", None)
        found |= (
            {name: command} if inner is None else {f"{name} {key}": value for key, value in inner.items()}
        )
    return found


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|").strip()


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
            assert all(f"`{spelt}`" in section for spelt in (*one.opts, *one.secondary_opts)), RENEW
    rows = [line for line in section.splitlines() if line.startswith("| `")]
    assert len(rows) == len(parameters), RENEW
