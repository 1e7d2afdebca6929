"""Serial adapters that are plugged in, by the names that stay the same when they are plugged in again."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

STABLE_NAMES = (Path("/dev/rcopterx"), Path("/dev/serial/by-id"))
"""Links to devices: those of our udev rules, then those that every Linux has."""


class Adapter(NamedTuple):
    """A serial adapter: the best name for a fleet file, the kernel's name now, and its own description."""

    port: str
    device: str
    description: str


BY_PLACE = Path("/dev/serial/by-path")
"""Links by the place where a device is plugged in."""


def plugged_in(directories: tuple[Path, ...] = STABLE_NAMES) -> list[Adapter]:
    """Adapters on USB, ordered by device."""
    found = [entry for entry in list_ports.comports() if entry.vid is not None]
    alike = {device for devices in _alike(found).values() for device in devices}
    return [
        Adapter(
            _stable_name(entry.device, (BY_PLACE,) if entry.device in alike else directories),
            entry.device,
            entry.description,
        )
        for entry in sorted(found, key=lambda entry: str(entry.device))
    ]


def with_same_serial_number(port: str) -> tuple[str, ...]:
    """Return the devices among which the name of a port leads to any; empty if it leads to one."""
    if Path(port).parent not in STABLE_NAMES:
        return ()
    device = str(Path(port).resolve())
    groups = _alike([entry for entry in list_ports.comports() if entry.vid is not None]).values()
    return next((devices for devices in groups if device in devices), ())


def _alike(entries: Sequence[ListPortInfo]) -> dict[str, tuple[str, ...]]:
    """Devices by the serial number that several of them have; ports of one adapter differ in place only."""
    found: dict[str, list[ListPortInfo]] = {}
    for entry in entries:
        if entry.serial_number:
            found.setdefault(entry.serial_number, []).append(entry)
    return {
        number: tuple(sorted(str(entry.device) for entry in alike))
        for number, alike in found.items()
        # Places on the USB, without the interface of an adapter with several ports.
        if len({str(entry.location or entry.device).partition(":")[0] for entry in alike}) > 1
    }


def _stable_name(device: str, directories: tuple[Path, ...]) -> str:
    for directory in directories:
        for link in sorted(directory.glob("*")):
            if link.resolve() == Path(device).resolve():
                return str(link)
    return device
