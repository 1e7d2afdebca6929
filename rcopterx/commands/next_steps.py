"""What `rcopterx` shows without a command: what to do next, depending on what is there."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from rcopterx.user_text import text_of

if TYPE_CHECKING:
    from rcopterx.deploy.hosts.running import RunningFleet

Step = tuple[str, str]  # a command, and what it does

ALL: Step = ("rcopterx --help", "all commands")


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
        return f"Fleet {up.fleet} is up, with {', '.join(up.vehicles)}.", [
            ("rcopterx check", "what prevents a take-off"),
            ("rcopterx takeoff", "take off and hover in formation"),
            (f"rcopterx goto {up.vehicles[0]} 0.3 0.2 1.2 90", "x y z in metres, yaw in degrees"),
            ("rcopterx ground --open", "the page in the browser"),
            ("rcopterx identify --all", "fit the models in flight, in a minute"),
            ("rcopterx land", "land and disarm"),
            ("rcopterx kill", "cut the motors at once"),
            ALL,
        ]
    if files:
        name = files[0]
        return f"No fleet is up. Fleet files here: {', '.join(files)}.", [
            (f"rcopterx margins {name}", "robustness of every vehicle"),
            (f"rcopterx up {name}", "start the fleet"),
            ("rcopterx ground --open", "the page in the browser, in a second terminal"),
            ALL,
        ]
    return "No fleet is up, and there is no fleet file here.", [
        ("rcopterx demo", "three simulated helicopters and the page to fly them"),
        ("rcopterx up trio", "the same fleet, to be flown from a second terminal"),
        ("rcopterx new-lab lab.toml", "write a fleet file for your laboratory"),
        ALL,
    ]
