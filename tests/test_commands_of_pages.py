"""Promises of all pages: every command on them can be run.

Commands of `rcopterx` are parsed with their options; targets of make and files of Python and pytest exist.
Commands of the operating system are listed by name, so every line of a page is checked.
"""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import typer

from rcopterx.command_line import app

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / ".github").rglob("*.md"),
        *(ROOT / "paper").glob("*.md"),
    ]
)
HISTORY = ("CHANGELOG.md", "commands.md")
"""Pages that name commands of earlier versions, and the generated usage of all commands."""
BLOCK = re.compile(r"^ *```(?:sh|console|bash)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
UNMARKED = re.compile(r"^```\n(.*?)^```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`((?:rcopterx|make|pytest|python) [^`]+)`")
NOT_OURS = {
    ".",
    "./fly",
    "cp",
    "docker",
    "echo",
    "g++",
    "jupyter",
    "octave-cli",
    "pip",
    "sed",
    "sudo",
}
"""Commands of the operating system and of others."""
WRITTEN = ("mine",)
"""Directories that a command of the page writes."""
LEAVES_WORDS_OUT = re.compile(r"\.\.\.|\[|<|\|")
"""Signs that a line describes commands instead of being one."""
COMMAND_LINE: Any = typer.main.get_command(app)


def commands_of(text: str) -> list[tuple[str, bool]]:
    """Commands of a page, and whether each is complete: lines of blocks are, mentions need not be."""
    found = []
    for block in BLOCK.findall(text):
        directory = ""
        for line in block.replace("\\\n", " ").splitlines():
            command = (
                line.partition(" #")[0].partition(" | ")[0].partition(" > ")[0].strip().removesuffix("&")
            ).strip()
            if command.startswith("cd "):
                directory = command.removeprefix("cd ") + "/"
            elif command:
                found.append((re.sub(r"^python (?!-)", f"python {directory}", command), True))
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


def target_is_there(words: list[str]) -> None:
    """A target of the Makefile; variables may follow."""
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert words[0] in targets
    assert all(re.fullmatch("(ARGS|PYTHON)=.*", word) for word in words[1:])


def script_is_there(words: list[str]) -> None:
    """A module, or a script whose source names every option; redirections are left out."""
    if words[0] == "-m":
        assert find_spec(words[1]) is not None
        return
    source = (ROOT / words[0]).read_text(encoding="utf-8")
    for word in words[1:]:
        assert not word.startswith("--") or f'"{word}"' in source, word


def paths_are_there(words: list[str]) -> None:
    """Files and folders for pytest."""
    if words[0] == "-m":
        words = words[2:]
    for word in words:
        assert word.startswith("-") or word in WRITTEN or (ROOT / word.partition("::")[0]).exists(), word


OURS = {
    "make": target_is_there,
    "python": script_is_there,
    "python3": script_is_there,
    "pytest": paths_are_there,
}


@pytest.mark.parametrize(("command", "complete"), EVERY)
def test_a_command_of_a_page_can_be_run(command: str, complete: bool) -> None:
    name, *words = shlex.split(command)
    name = name.rpartition("/")[2] if name.startswith(".venv/") else name
    if name == "rcopterx":
        understood(words, complete)
    elif name in OURS:
        OURS[name](words)
    else:
        assert name in NOT_OURS, f"{name}: a command of a page that nothing checks"


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.name not in HISTORY], ids=lambda page: page.name
)
def test_no_command_hides_in_a_block_without_a_language(page: Path) -> None:
    for block in UNMARKED.findall(page.read_text(encoding="utf-8")):
        first = [line.split()[0] for line in block.splitlines() if line.split()]
        assert not {"rcopterx", *NOT_OURS, *OURS} & set(first), "mark the block as sh"


def test_commands_are_found_in_blocks_and_in_sentences() -> None:
    page = (
        "```sh\ncd a\npython b.py\nrcopterx up trio   # start\nrcopterx top &\n```\n`rcopterx goto` and `x`"
    )
    assert commands_of(page) == [
        ("python a/b.py", True),
        ("rcopterx up trio", True),
        ("rcopterx top", True),
        ("rcopterx goto", False),
    ]
    assert len(EVERY) > 150


@pytest.mark.parametrize(
    "command", ["rcopterx fligh", "rcopterx up trio --fast", "rcopterx goto h1 a b c", "rcopterx goto h1 0"]
)
def test_a_command_that_does_not_exist_is_found(command: str) -> None:
    with pytest.raises(typer.BadParameter.__base__):  # type: ignore[arg-type]
        understood(shlex.split(command)[1:], complete=True)
