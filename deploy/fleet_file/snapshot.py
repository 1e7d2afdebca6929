"""A snapshot of a fleet file: what the processes of a fleet go by for as long as the fleet is up."""

import hashlib
from pathlib import Path

import msgspec

from rcopterx.deploy.fleet_file.schema import FleetError, FleetFile

SUFFIX = ".json"


def write_snapshot(fleet: FleetFile, path: Path) -> None:
    """Write everything the file said, defaults included, so that later changes of the file change nothing."""
    temporary = path.with_suffix(".new")
    temporary.write_bytes(msgspec.json.encode(fleet))
    temporary.replace(path)


def read_snapshot(path: Path) -> FleetFile:
    """Fleet of a snapshot.

    Raises
    ------
    FleetError
        The file cannot be read or is no snapshot.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=FleetFile)
    except OSError as error:
        raise FleetError(f"{path}: cannot be read: {error.strerror}") from None
    except msgspec.DecodeError as error:
        raise FleetError(f"{path}: not a snapshot of a fleet file: {error}") from None


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
