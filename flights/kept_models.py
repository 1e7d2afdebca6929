"""Learned models between flights, beside the flight logs: one file for each vehicle."""

import time
from pathlib import Path
from typing import Any

import msgspec

from rcopterx.control.identification.fit import WORSE, errors_ahead
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.control.identification.result import PARTS, Identification
from rcopterx.places import replace_file
from rcopterx.vehicles.model import Model, fitted_parameters, with_parameters


class KeptModel(msgspec.Struct, frozen=True):
    """What a vehicle has learned in one flight."""

    date: str
    hover_thrust: float | None  # share of the largest thrust, which shows the battery of that flight
    before: dict[str, Any]  # parameters of the model by the fleet file, which it departs from
    parts: tuple[str, ...]
    parameters: dict[str, Any]

    @classmethod
    def of(cls, before: Model, found: Identification, hover_thrust: float | None) -> "KeptModel":
        """Return what a fit has found now."""
        date = time.strftime("%Y-%m-%d %H:%M")
        own = fitted_parameters(found.model)
        return cls(date, hover_thrust, fitted_parameters(before), found.accepted, own)


def _path(directory: Path, vehicle: str) -> Path:
    return directory / f"{vehicle}.json"


def write_kept(directory: Path, vehicle: str, kept: KeptModel) -> None:
    """Keep a model in place of the one before; a disk that is full or read-only keeps none."""
    path = _path(directory, vehicle)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        replace_file(path, msgspec.json.format(msgspec.json.encode(kept)))
    except OSError:
        path.unlink(missing_ok=True)


def read_kept(directory: Path, vehicle: str, model: Model) -> KeptModel | None:
    """Return the kept model of a vehicle; None without one, or if the fleet file has changed its model."""
    try:
        kept = msgspec.json.decode(_path(directory, vehicle).read_bytes(), type=KeptModel)
    except (OSError, msgspec.DecodeError):
        return None
    present = msgspec.to_builtins(fitted_parameters(model))
    return kept if msgspec.to_builtins(kept.before) == present else None


def agrees(kept: KeptModel, model: Model, flight: FlightRecording) -> bool:
    """Whether a kept model predicts a flight as well as the model by the fleet file, in all learned parts."""
    before, now = (errors_ahead(one, flight) for one in (model, with_parameters(model, kept.parameters)))
    return all(now[part] <= WORSE * before[part] for part in PARTS if part in kept.parts)
