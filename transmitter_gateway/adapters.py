"""Serial adapters that are plugged in, by the names that stay the same when they are plugged in again."""

from pathlib import Path
from typing import NamedTuple

from serial.tools import list_ports

STABLE_NAMES = (Path("/dev/rcopterx"), Path("/dev/serial/by-id"))
"""Links to devices: those of our udev rules, then those that every Linux has."""


class Adapter(NamedTuple):
    """A serial adapter: the best name for a fleet file, the kernel's name now, and its own description."""

    port: str
    device: str
    description: str


def plugged_in(directories: tuple[Path, ...] = STABLE_NAMES) -> list[Adapter]:
    """Adapters on USB, ordered by device."""
    found = [entry for entry in list_ports.comports() if entry.vid is not None]
    return [
        Adapter(_stable_name(entry.device, directories), entry.device, entry.description)
        for entry in sorted(found, key=lambda entry: str(entry.device))
    ]


def _stable_name(device: str, directories: tuple[Path, ...]) -> str:
    for directory in directories:
        for link in sorted(directory.glob("*")):
            if link.resolve() == Path(device).resolve():
                return str(link)
    return device
