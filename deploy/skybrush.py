"""Reads drone shows: Skybrush's `.skyc`, or a zip of CSV files with one drone each; lights are left out.

A `.skyc` file is a zip archive. Its `show.json` lists the drones (`swarm.drones[].settings`), each with a
trajectory of version 1, in place or by reference to another file of the archive. A trajectory is a list of
keyframes: seconds after the take-off, position in metres, and the inner control points of the Bezier curve
that leads there: none (a straight line), one or two.
"""

import csv
import json
import math
import zipfile
import zlib
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from rcopterx.deploy.new_laboratory import NewVehicle, PlacedVehicle, formation_of
from rcopterx.fleet.schema import FleetError
from rcopterx.vehicles.state import Array

STEP_S: Final = 0.25
MAX_MEMBER_BYTES: Final = 20_000_000
MAX_DURATION_S: Final = 3600.0


class ShowError(FleetError):
    """The file is no valid show; the text names the wrong part."""


class Drone(NamedTuple):
    """One drone of a show."""

    name: str
    times_s: Array  # since the beginning of the show, increasing, shape (n,)
    positions_m: Array  # shape (n, 3)


def read_show(path: Path) -> list[Drone]:
    """All drones of a show file, in its order; raises ShowError."""
    try:
        with zipfile.ZipFile(path) as archive:
            if "show.json" in archive.namelist():
                drones = _drones_of_skyc(archive)
            else:
                names = sorted(name for name in archive.namelist() if name.lower().endswith(".csv"))
                drones = [_drone_of_csv(archive, name) for name in names]
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, csv.Error) as error:
        raise ShowError(f"{path}: {error}") from None
    if not drones:
        raise ShowError(f"{path}: neither show.json nor CSV files in it")
    return drones


def read_vehicles(path: Path) -> list[NewVehicle]:
    """Return a simulated vehicle for each drone of a show file, at its first position; raises FleetError."""
    placed = [PlacedVehicle(drone.name, None, drone.positions_m[0]) for drone in read_show(path)]
    return formation_of(path, placed, "drone_")


def _read(archive: zipfile.ZipFile, name: str) -> bytes:
    try:
        member = archive.getinfo(name)
    except KeyError:
        raise ShowError(f"{name} is missing in the archive") from None
    if member.file_size > MAX_MEMBER_BYTES:
        raise ShowError(f"{name} is larger than {MAX_MEMBER_BYTES} bytes")
    return archive.read(member)


def _drones_of_skyc(archive: zipfile.ZipFile) -> list[Drone]:
    show = _json(archive, "show.json")
    try:
        settings = [drone["settings"] for drone in show["swarm"]["drones"]]
        return [_drone_of_settings(archive, entry, number) for number, entry in enumerate(settings, 1)]
    except (KeyError, TypeError, AttributeError) as error:
        raise ShowError(f"show.json: {error!r} is missing or of another kind") from None


def _json(archive: zipfile.ZipFile, name: str) -> Any:
    content = _read(archive, name)
    try:
        return json.loads(content)
    except ValueError as error:
        raise ShowError(f"{name}: no JSON: {error}") from None


def _drone_of_settings(archive: zipfile.ZipFile, settings: dict[str, Any], number: int) -> Drone:
    name = str(settings.get("name", f"drone {number}"))
    trajectory = settings["trajectory"]
    if "$ref" in trajectory:
        file = trajectory["$ref"].partition("#")[0].removeprefix("./")
        trajectory = _json(archive, file)
    if trajectory.get("version") != 1:
        raise ShowError(f"{name}: version {trajectory.get('version')!r} of the trajectory, only 1 is known")
    try:
        times_s, positions_m = _sampled(trajectory["points"])
        times_s += float(trajectory.get("takeoffTime", 0.0))
    except ValueError as error:
        raise ShowError(f"{name}: {error}") from None
    return _checked(name, times_s, positions_m)


def _sampled(points: Any) -> tuple[Array, Array]:
    """Times and positions along the keyframes."""
    (time_s, start, _), *others = points
    times, positions = [float(time_s)], [start]
    for end_s, end, inner in others:
        control = np.array([start, *inner, end], dtype=float)
        if control.shape[1:] != (3,) or len(control) > 4:
            raise ValueError(f"the keyframe at {end_s:g} s has no position or more than two control points")
        if not time_s < end_s <= MAX_DURATION_S:
            raise ValueError(f"the keyframe at {end_s:g} s does not come after {time_s:g} s")
        steps = max(1, math.ceil((end_s - time_s) / STEP_S))
        further_s = np.linspace(time_s, end_s, steps + 1)[1:]
        times += further_s.tolist()
        positions += BPoly(control[:, np.newaxis], [time_s, end_s])(further_s).tolist()
        time_s, start = end_s, end
    return np.array(times), np.array(positions, dtype=float)


def _drone_of_csv(archive: zipfile.ZipFile, name: str) -> Drone:
    """Columns: time [ms], x, y, z [m]; further ones (red, green, blue) and the heading are left out."""
    rows = list(csv.reader(_read(archive, name).decode("utf-8-sig", "replace").splitlines()))[1:]
    try:
        table = np.array([[float(value) for value in row[:4]] for row in rows])
    except ValueError as error:
        raise ShowError(f"{name}: {error}") from None
    if table.ndim != 2 or table.shape[1] != 4:
        raise ShowError(f"{name}: needs the columns time [ms], x, y, z [m]")
    return _checked(name, 1e-3 * table[:, 0], table[:, 1:])


def _checked(name: str, times_s: Array, positions_m: Array) -> Drone:
    if len(times_s) < 2 or positions_m.shape != (len(times_s), 3):
        raise ShowError(f"{name}: at least two positions with x, y, z are needed")
    if not (np.isfinite(times_s).all() and np.isfinite(positions_m).all()):
        raise ShowError(f"{name}: every number must be finite")
    if (np.diff(times_s) <= 0).any():
        raise ShowError(f"{name}: times must increase")
    return Drone(name, times_s, positions_m)
