"""What `rcopterx` shows without a command: what to do next, depending on what is there."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from rcopterx.tables import table_beside
from rcopterx.user_text import text_of

if TYPE_CHECKING:
    from rcopterx.deploy.hosts.running import RunningFleet

Step = tuple[str, str]  # a command, and what it does


def show_next_steps() -> None:
    """Print the steps for the fleets that are up, and for the fleet files in the working directory."""
    from rcopterx.deploy.hosts.running import running_fleets

    title, steps = next_steps(list(running_fleets()), fleet_files(Path()))
    width = max(len(command) for command, _ in steps)
    typer.echo("\n".join((title, *(f"  {command:{width}}  {text}" for command, text in steps))))


def fleet_files(directory: Path) -> list[str]:
    """Return the names of the fleet files in a directory; files that cannot be read are none."""
    return [path.name for path in sorted(directory.glob("*.toml")) if _has_vehicles(path)]


def _has_vehicles(path: Path) -> bool:
    try:
        return "vehicles" in tomllib.loads(text_of(path))
    except (OSError, ValueError):
        return False


def next_steps(running: "Sequence[RunningFleet]", files: Sequence[str]) -> tuple[str, list[Step]]:
    """Return a title and the steps that come next, by the fleets that are up and the files here."""
    if running:
        up = running[0]
        return _filled("up", fleet=up.fleet, vehicles=", ".join(up.vehicles), first=up.vehicles[0])
    if files:
        return _filled("files", files=", ".join(files), first=files[0])
    return _filled("nothing")


def _filled(case: str, **names: str) -> tuple[str, list[Step]]:
    """Return title and steps of a case of `next_steps.toml`, with the names in their places."""
    table = table_beside(__file__, "next_steps")[case]
    steps = [(command.format(**names), text) for command, text in table["steps"]]
    return table["title"].format(**names), steps
