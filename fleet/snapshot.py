"""Snapshots of a fleet file, which the processes of a fleet read while the fleet is up."""

import hashlib
from pathlib import Path

import msgspec

from rcopterx.fleet.schema import FleetError, FleetFile

SUFFIX = ".json"


def write_snapshot(fleet: FleetFile, path: Path) -> None:
    """Write a fleet file with its defaults, so that later changes of the file have no effect."""
    temporary = path.with_suffix(".new")
    temporary.write_bytes(encoded(fleet))
    temporary.replace(path)


def encoded(fleet: FleetFile) -> bytes:
    """Return the content of a snapshot."""
    return msgspec.json.encode(fleet)


def read_snapshot(path: Path) -> FleetFile:
    """Return the fleet of a snapshot.

    Raises `FleetError`: the file cannot be read or is no snapshot.
    """
    try:
        return snapshot_of(path.read_bytes())
    except OSError as error:
        raise FleetError(f"{path}: cannot be read: {error.strerror}") from None
    except FleetError as error:
        raise FleetError(f"{path}: {error}") from None


def snapshot_of(content: bytes) -> FleetFile:
    """Return the fleet of the content of a snapshot.

    Raises `FleetError`: it is no snapshot.
    """
    try:
        return msgspec.json.decode(content, type=FleetFile)
    except msgspec.DecodeError as error:
        raise FleetError(f"not a snapshot of a fleet file: {error}") from None


def digest_of(fleet: FleetFile) -> str:
    """Return a short digest that identifies a fleet.

    It ignores comments, order, calibrations and models: `rcopterx calibrate` and `rcopterx identify` may
    change the file while the fleet is up.
    """
    plain = msgspec.to_builtins(fleet)
    for vehicle in plain["vehicles"].values():
        del vehicle["transmitter"]["calibration"]
        del vehicle["model"]
    return hashlib.sha256(msgspec.json.encode(plain, order="deterministic")).hexdigest()[:12]
