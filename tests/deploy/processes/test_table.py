"""Promises of the processes of a fleet as data."""

import sys
from pathlib import Path

from rcopterx.deploy.processes.table import ProcessSpec


def test_a_command_line_names_the_role_of_its_process() -> None:
    command = ProcessSpec("agent-h1", "agent", "h1").command(Path("/x/lab.toml"))
    assert command == [sys.executable, "-m", "rcopterx.deploy.roles", "agent", "h1", "/x/lab.toml"]
    moved = ProcessSpec("agent-h1", "agent", "h1", "second").command(Path("/x/lab.toml"), take_over=True)
    assert moved == [*command, "second", "--take-over"]
