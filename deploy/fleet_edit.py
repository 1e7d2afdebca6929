"""Writes a calibration back into a fleet file: comments survive, and the file is never half written."""

import os
import tempfile
from collections.abc import MutableMapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from deploy.fleet_file.reading import load_fleet, parse_fleet
from deploy.fleet_file.schema import FleetError
from deploy.fleet_file.shipped import shipped_fleets
from deploy.roles.transmitters import calibration_of
from transmitter_gateway.calibration import Calibration

CHANNELS = ("pitch", "roll", "throttle", "yaw")


def write_calibration(path: Path, vehicle: str, calibration: Calibration) -> list[str]:
    """Replace what differs in the calibration of a vehicle.

    Parameters
    ----------
    path
        Fleet file; it keeps its comments, its order and its permissions.
    vehicle
        Name of the vehicle.
    calibration
        What the file shall say.

    Returns
    -------
    list of str
        What was changed, a line each: field, old and new value.

    Raises
    ------
    FleetError
        The file cannot be used, or comes with the package and belongs to everybody; nothing was written.
    """
    path = path.resolve()
    if path in (shipped.resolve() for shipped in shipped_fleets().values()):
        raise FleetError(f"{path}: comes with the package and is not changed; copy it and use the copy")
    present = calibration_of(load_fleet(path).vehicles[vehicle], vehicle)
    text = path.read_text(encoding="utf-8")
    try:
        document = tomlkit.parse(text)
    except TOMLKitError as error:
        raise FleetError(f"{path}: not TOML: {error}") from None
    table: Any = document
    for key in ("vehicles", vehicle, "transmitter", "calibration"):
        if key not in table:
            table[key] = tomlkit.inline_table()
        table = table[key]
    lines = []
    for channel in CHANNELS:
        if getattr(present, channel) != getattr(calibration, channel):
            lines += _set_channel(table, channel, present, calibration)
    if not lines:
        return []
    changed = tomlkit.dumps(document)
    if calibration_of(parse_fleet(changed).vehicles[vehicle], vehicle) != calibration:
        raise FleetError(f"{path}: vehicles.{vehicle}.transmitter.calibration cannot be changed by a program")
    _replace(path, changed)
    return lines


def _set_channel(
    table: MutableMapping[str, Any], channel: str, present: Calibration, wanted: Calibration
) -> list[str]:
    before, after = getattr(present, channel), getattr(wanted, channel)
    if channel not in table:
        table[channel] = tomlkit.inline_table()
    lines = []
    for item in fields(after):
        old, new = getattr(before, item.name), getattr(after, item.name)
        # A table that is new must repeat what differs from the defaults of a channel of any kind.
        if old != new or (
            item.name not in table[channel] and (item.default is MISSING or new != item.default)
        ):
            table[channel][item.name] = new
        if old != new:
            lines.append(f"{channel}.{item.name}: {old:g} -> {new:g}")
    return lines


def _replace(path: Path, text: str) -> None:
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, path.stat().st_mode & 0o7777)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
