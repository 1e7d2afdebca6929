"""A snapshot of a fleet file: what the processes of a fleet go by for as long as the fleet is up."""

import hashlib
from pathlib import Path

import msgspec

from rcopterx.fleet.schema import FleetError, FleetFile

SUFFIX = ".json"


def write_snapshot(fleet: FleetFile, path: Path) -> None:
    """Write everything the file said, defaults included, so that later changes of the file change nothing."""
    temporary = path.with_suffix(".new")
    temporary.write_bytes(encoded(fleet))
    temporary.replace(path)


def encoded(fleet: FleetFile) -> bytes:
    """What a snapshot holds."""
    return msgspec.json.encode(fleet)


def read_snapshot(path: Path) -> FleetFile:
    """Fleet of a snapshot.

    Raises
    ------
    FleetError
        The file cannot be read or is no snapshot.
    """
    try:
        return snapshot_of(path.read_bytes())
    except OSError as error:
        raise FleetError(f"{path}: cannot be read: {error.strerror}") from None
    except FleetError as error:
        raise FleetError(f"{path}: {error}") from None


def snapshot_of(content: bytes) -> FleetFile:
    """Fleet that was `encoded`.

    Raises
    ------
    FleetError
        It was not.
    """
    try:
        return msgspec.json.decode(content, type=FleetFile)
    except msgspec.DecodeError as error:
        raise FleetError(f"not a snapshot of a fleet file: {error}") from None


def digest_of(fleet: FleetFile) -> str:
    """Short digest of a fleet file; two files with the same one mean the same fleet.

    Comments and order do not count. Neither do calibrations and models, which `rcopterx calibrate` and
    `rcopterx identify` may write while the fleet is up: it goes on with those it was started with.
    """
    plain = msgspec.to_builtins(fleet)
    for vehicle in plain["vehicles"].values():
        del vehicle["transmitter"]["calibration"]
        del vehicle["model"]
    return hashlib.sha256(msgspec.json.encode(plain, order="deterministic")).hexdigest()[:12]
