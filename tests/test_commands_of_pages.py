"""Promises of all pages: every `rcopterx` command on them is one that the command line understands."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from rcopterx.command_line import app

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / ".github").rglob("*.md")])
HISTORY = ("CHANGELOG.md", "decisions.md")
"""These tell of commands as they were."""
BLOCK = re.compile(r"^ *```(?:sh|console|bash)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(rcopterx [^`]+)`")
LEAVES_WORDS_OUT = re.compile(r"\.\.\.|\[|<|\|")
"""Signs that a line describes commands instead of being one."""
COMMAND_LINE: Any = typer.main.get_command(app)


def commands_of(text: str) -> list[tuple[str, bool]]:
    """Commands of a page, and whether each is complete: lines of blocks are, mentions need not be."""
    found = []
    for block in BLOCK.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            command = (
                line.partition(" #")[0].partition(" | ")[0].partition(" > ")[0].strip().removesuffix("&")
            )
            if command.startswith("rcopterx "):
                found.append((command.strip(), True))
    inline = BLOCK.sub("", text)
    found += [(command, False) for command in INLINE.findall(inline) if not LEAVES_WORDS_OUT.search(command)]
    return found


EVERY = [
    pytest.param(command, complete, id=f"{page.name}: {command}")
    for page in PAGES
    if page.name not in HISTORY
    for command, complete in dict.fromkeys(commands_of(page.read_text(encoding="utf-8")))
]


def understood(words: list[str], complete: bool) -> None:
    """Parse a command with its arguments and options; nothing is run."""
    command, context = COMMAND_LINE, None
    name = "rcopterx"
    while True:
        try:
            context = command.make_context(name, words, parent=context)
        except typer.Exit:
            return
        except typer.BadParameter as error:
            # Files of an example are not there, and a mention in a sentence may leave arguments out.
            left_out = not complete and type(error).__name__ == "MissingParameter"
            if left_out or "does not exist" in str(error):
                return
            raise
        rest = [*getattr(context, "_protected_args", ()), *context.args]
        if not hasattr(command, "resolve_command"):
            assert not rest, f"too many words: {rest}"
            return
        name, command, words = command.resolve_command(context, rest)


@pytest.mark.parametrize(("command", "complete"), EVERY)
def test_a_command_of_a_page_is_understood(command: str, complete: bool) -> None:
    understood(shlex.split(command)[1:], complete)


def test_commands_are_found_in_blocks_and_in_sentences() -> None:
    page = "```sh\nmake demo\nrcopterx up trio   # start\nrcopterx top &\n```\n`rcopterx goto` and `x`"
    assert commands_of(page) == [
        ("rcopterx up trio", True),
        ("rcopterx top", True),
        ("rcopterx goto", False),
    ]
    assert len(EVERY) > 80


@pytest.mark.parametrize(
    "command", ["rcopterx fligh", "rcopterx up trio --fast", "rcopterx goto h1 a b c", "rcopterx goto h1 0"]
)
def test_a_command_that_does_not_exist_is_found(command: str) -> None:
    with pytest.raises(typer.BadParameter.__base__):  # type: ignore[arg-type]
        understood(shlex.split(command)[1:], complete=True)
