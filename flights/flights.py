"""Flight logs of a directory, such as the parts `trio-20261122-141500-7.000.mcap`, `...001.mcap`."""

import os
import re
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rcopterx.bus.keys import ROOT

SUFFIX: Final = ".mcap"
NEWEST: Final = "latest"
NUMBERED: Final = 3  # dashes in the name of a flight with a number
_PART: Final = re.compile(r"^(?P<flight>[a-z][a-z0-9_]*-\d{8}-\d{6}(?:-\d+)?)\.(?P<number>\d{3,})\.mcap$")


class NoFlightError(ValueError):
    """No such flight; names the directory."""


@dataclass(frozen=True)
class Flight:
    """One recorded flight: its name from fleet, start and number, and its files in order."""

    name: str
    parts: tuple[Path, ...]

    @property
    def size_bytes(self) -> int:
        """Size of all files."""
        return sum(path.stat().st_size for path in self.parts)


def default_directory() -> Path:
    """Return the directory of flight logs: `RCOPTERX_FLIGHTS`, else one in the user's data directory."""
    if chosen := os.environ.get("RCOPTERX_FLIGHTS"):
        return Path(chosen)
    home = os.path.expanduser("~")  # "~" itself where neither HOME nor the system names one
    place = Path(home) / ".local" / "share" if os.path.isabs(home) else Path(tempfile.gettempdir())
    return Path(os.environ.get("XDG_DATA_HOME") or place) / ROOT / "flights"


def new_flight_name(fleet: str, started_s: float, directory: Path) -> str:
    """Return the name of a flight that begins at a time of the wall clock: fleet, date, time, number.

    The number is one more than the largest in the directory: clocks of boards without a battery repeat.
    """
    number = 1
    with suppress(OSError):  # the recorder will report why the directory is unusable
        number += max((_number(part["flight"]) for part in _parts(directory)), default=0)
    return f"{fleet}-{time.strftime('%Y%m%d-%H%M%S', time.localtime(started_s))}-{number}"


def part_path(directory: Path, flight: str, number: int) -> Path:
    """Return the path of a part of a flight."""
    return directory / f"{flight}.{number:03d}{SUFFIX}"


def next_part(directory: Path, flight: str) -> int:
    """Return the number of the next part of a flight; a restarted recorder continues its flight."""
    return 1 + max(
        (int(part["number"]) for part in _parts(directory) if part["flight"] == flight), default=-1
    )


def missing_parts(flight: Flight) -> list[int]:
    """Return the numbers of the parts that a flight lacks before its last one."""
    found = [part for path in flight.parts if (part := _PART.match(path.name))]
    numbers = {int(part["number"]) for part in found if part["flight"] == flight.name}
    return sorted(set(range(max(numbers, default=0))) - numbers)


def flights_in(directory: Path) -> list[Flight]:
    """Return the flights of a directory, the oldest first; other files are ignored.

    Raises OSError if the directory cannot be read.
    """
    parts: dict[str, list[Path]] = {}
    for part in sorted(_parts(directory), key=lambda part: (int(part["number"]), part[0])):
        parts.setdefault(part["flight"], []).append(directory / part[0])
    # By number; without one by date and time of the start; then by name.
    by_start = sorted(parts, key=lambda flight: (_number(flight), flight.partition("-")[2], flight))
    return [Flight(name, tuple(parts[name])) for name in by_start]


def _parts(directory: Path) -> list[re.Match[str]]:
    """Return the names of all parts; raises OSError unless the directory can be read or is missing."""
    try:
        names = os.listdir(directory)
    except FileNotFoundError:
        return []
    return [part for name in names if (part := _PART.match(name))]


def _number(flight: str) -> int:
    """Return the number of a flight, 0 for those of versions that did not number them."""
    return int(flight.split("-")[3]) if flight.count("-") == NUMBERED else 0


def found_flight(name: str, directory: Path) -> Flight:
    """Return the flight of a file, of a name, or the newest one for `latest`; raises `NoFlightError`."""
    path = Path(name)
    if path.is_file():
        return Flight(path.name.removesuffix(SUFFIX), (path,))
    flights = flights_in(directory)
    found = flights[-1:] if name == NEWEST else [flight for flight in flights if flight.name == name]
    if found:
        return found[0]
    if name == NEWEST:
        raise NoFlightError(f"no flights in {directory}; each fleet that is started records one")
    raise NoFlightError(f"neither a file nor a flight {name!r} in {directory}; rcopterx flights lists them")


def too_many(sizes: Iterable[tuple[Path, int]], limit_bytes: int) -> list[Path]:
    """Return the first files of a list whose removal brings the total size within a limit."""
    files, gone = list(sizes), []
    left_bytes = sum(size for _, size in files)
    for path, size in files:
        if left_bytes > limit_bytes:
            gone.append(path)
        left_bytes -= size
    return gone
