"""Flight logs of a directory, such as the parts `trio-20261122-141500.000.mcap`, `...001.mcap`."""

import os
import re
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rcopterx.bus.keys import ROOT

SUFFIX: Final = ".mcap"
NEWEST: Final = "latest"
_PART: Final = re.compile(r"^(?P<flight>[a-z][a-z0-9_]*-\d{8}-\d{6}(?:-\d+)?)\.(?P<number>\d{3,})\.mcap$")


class NoFlightError(ValueError):
    """No such flight; names the directory."""


@dataclass(frozen=True)
class Flight:
    """One recorded flight: its name from fleet, date and time of its start, and its files in order."""

    name: str
    parts: tuple[Path, ...]

    @property
    def size_bytes(self) -> int:
        """Size of all files."""
        return sum(path.stat().st_size for path in self.parts)


def default_directory() -> Path:
    """Return the directory of flight logs: `RCOPTERX_FLIGHTS`, else one in the user's data directory."""
    chosen = os.environ.get("RCOPTERX_FLIGHTS")
    if chosen:
        return Path(chosen)
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / ROOT / "flights"


def flight_name(fleet: str, started_s: float) -> str:
    """Return the name of a flight that begins at a time of the wall clock."""
    return f"{fleet}-{time.strftime('%Y%m%d-%H%M%S', time.localtime(started_s))}"


def part_path(directory: Path, flight: str, number: int) -> Path:
    """Return the path of a part of a flight."""
    return directory / f"{flight}.{number:03d}{SUFFIX}"


def next_part(directory: Path, flight: str) -> int:
    """Return the number of the next part of a flight; a restarted recorder continues its flight."""
    return 1 + max(
        (int(part["number"]) for part in _parts(directory) if part["flight"] == flight), default=-1
    )


def flights_in(directory: Path) -> list[Flight]:
    """Return the flights of a directory, the oldest first; other files are ignored."""
    parts: dict[str, list[Path]] = {}
    for part in sorted(_parts(directory), key=lambda part: (int(part["number"]), part[0])):
        parts.setdefault(part["flight"], []).append(directory / part[0])
    by_start = sorted(parts.items(), key=lambda item: _started(item[0]))
    return [Flight(name, tuple(paths)) for name, paths in by_start]


def _parts(directory: Path) -> list[re.Match[str]]:
    return [part for path in directory.glob(f"*{SUFFIX}") if (part := _PART.match(path.name))]


def _started(name: str) -> tuple[str, str]:
    """Sort key of a flight: date and time of its start, then its name."""
    return name.partition("-")[2], name


def found_flight(name: str, directory: Path) -> Flight:
    """Return the flight of a file, of a name, or the newest one for `latest`; raises `NoFlightError`."""
    path = Path(name)
    if path.is_file():
        return Flight(path.name.removesuffix(SUFFIX), (path,))
    flights = flights_in(directory)
    if name == NEWEST and flights:
        return flights[-1]
    for flight in flights:
        if flight.name == name:
            return flight
    if name == NEWEST:
        raise NoFlightError(f"no flights in {directory}; each fleet that is started records one")
    raise NoFlightError(f"neither a file nor a flight {name!r} in {directory}; rcopterx flights lists them")


def too_many(sizes: Iterable[tuple[Path, int]], limit_bytes: int) -> list[Path]:
    """Return the first files of a list whose removal brings the total size within a limit."""
    files = list(sizes)
    total = sum(size for _, size in files)
    gone = []
    for path, size in files:
        if total <= limit_bytes:
            break
        gone.append(path)
        total -= size
    return gone
