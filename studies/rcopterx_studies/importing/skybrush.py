"""Reads drone shows: Skybrush's `.skyc`, or a zip of CSV files with one drone each; pyros are left out.

A `.skyc` file is a zip archive. Its `show.json` lists the drones (`swarm.drones[].settings`), each with a
trajectory, and maybe lights and a heading, of version 1, in place or by reference to another file. Keyframes
of a trajectory are seconds after the take-off, position in metres, and the inner control points of the Bezier
curve that leads there: none (a straight line) to six. Lights, byte code that `examples/light_show` plays, and
headings begin with the show.
"""

import base64
import codecs
import json
import math
import posixpath
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from rcopterx.deploy.new_laboratory import NewVehicle
from rcopterx.fleet.schema import FleetError, errors_at
from rcopterx.user_text import Row, TextError, decoded, number_in, rows_of
from rcopterx.vehicles.state import Array
from rcopterx_studies.importing.formation import formation_of

STEP_S: Final = 0.25
MAX_MEMBER_BYTES: Final = 20_000_000
MAX_DURATION_S: Final = 3600.0
HIGHEST_DEGREE: Final = 7  # of the polynomials between keyframes
SLOW_M_S: Final = 0.1  # up to this speed the direction is no heading
COLUMNS: Final = ("time [ms]", "x [m]", "y [m]", "z [m]", "red", "green", "blue")
SHOW: Final = "show.json"
PARTS: Final = ("trajectory", "lights", "yawControl")  # of the settings of a drone
MAC_FOLDER: Final = "__MACOSX"


class ShowError(FleetError):
    """The file is no valid show; the text names the wrong part."""


class Drone(NamedTuple):
    """One drone of a show."""

    name: str
    times_s: Array  # since the beginning of the show, increasing, shape (n,)
    positions_m: Array  # shape (n, 3)
    yaws_rad: Array  # counter-clockwise from the x axis, with whole turns, shape (n,)
    lights: bytes | Array | None = None  # a light program of Skybrush, or red, green, blue at each time


class _Archive:
    """The files of a zip archive without what macOS adds, by their paths below the folder of the show."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        found = {PurePosixPath(info.filename.replace("\\", "/")): info for info in archive.infolist()}
        kept = {
            path: info
            for path, info in found.items()
            if not info.is_dir() and MAC_FOLDER not in path.parts and not path.name.startswith(".")
        }
        shows = sorted((path for path in kept if path.name == SHOW), key=lambda path: len(path.parts))
        if len(shows) > 1:
            raise ShowError(f"{len(shows)} files {SHOW}: {', '.join(map(str, shows))}")
        folders = {path.parent for path in shows or kept}
        folder = folders.pop() if len(folders) == 1 else PurePosixPath()
        self.members = {
            str(path.relative_to(folder)): info for path, info in kept.items() if path.is_relative_to(folder)
        }
        self.tables = sorted(name for name in self.members if name.lower().endswith(".csv") and not shows)

    def read(self, name: str) -> bytes:
        """Return the content of a file; raises `ShowError`."""
        if (member := self.members.get(posixpath.normpath(name))) is None:
            raise ShowError(f"{name} is missing in the archive")
        if member.file_size > MAX_MEMBER_BYTES:
            raise ShowError(f"{name} is larger than {MAX_MEMBER_BYTES} bytes")
        return self._archive.read(member)


def read_show(path: Path) -> list[Drone]:
    """All drones of a show file, in its order; raises ShowError."""
    try:
        with zipfile.ZipFile(path) as file:
            archive = _Archive(file)
            drones = [_drone_of_csv(archive, name) for name in archive.tables]
            drones += _drones_of_skyc(archive) if SHOW in archive.members else []
    except zipfile.BadZipFile as error:
        raise ShowError(f"{path}: {_other_format(path) or error}") from None
    except (OSError, zlib.error, EOFError, RuntimeError, FleetError) as error:
        raise ShowError(f"{path}: {error}") from None
    if not drones:
        raise ShowError(f"{path}: neither {SHOW} nor CSV files in it")
    return drones


def _other_format(path: Path) -> str:
    """Return what a file is that is no archive, and what to export instead."""
    with path.open("rb") as file:
        begin = file.read(64).removeprefix(codecs.BOM_UTF8).lstrip()
    if begin.startswith(b"skyb") or path.suffix.lower() == ".skyb":
        kind = "a .skyb file, the show of one drone for its autopilot"
    elif begin.startswith((b"{", b"[")) or path.suffix.lower() == ".json":
        kind = "a JSON file, a part of a show"
    elif path.suffix.lower() == ".csv":
        kind = "the CSV file of one drone"
    else:
        return ""
    return f"{kind}; export the whole show as .skyc, or as CSV files and zip them"


def read_vehicles(path: Path) -> list[NewVehicle]:
    """Return a simulated vehicle for each drone of a show file, at its first position; raises FleetError."""
    drones = read_show(path)
    placed = [NewVehicle(one.name, one.name, "", "coaxial", one.positions_m[0].tolist()) for one in drones]
    return formation_of(path, placed, "drone_")


def _drones_of_skyc(archive: _Archive) -> list[Drone]:
    show = _json(archive, SHOW)
    try:
        drones = enumerate(show["swarm"]["drones"], 1)
        return [_drone_of_settings(archive, drone["settings"], number) for number, drone in drones]
    except (KeyError, TypeError, AttributeError) as error:
        raise ShowError(f"{SHOW}: {error!r} is missing or of another kind") from None


def _json(archive: _Archive, name: str) -> Any:
    content = archive.read(name)
    with errors_at(f"{name}: no JSON", ValueError):
        return json.loads(content)


def _drone_of_settings(archive: _Archive, settings: dict[str, Any], number: int) -> Drone:
    name = str(settings.get("name", f"drone {number}"))
    with errors_at(name, ValueError, IndexError, OverflowError):
        trajectory, lights, heading = (_part(archive, settings, part) for part in PARTS)
        times_s, positions_m = _sampled(trajectory["points"])
        times_s += float(trajectory.get("takeoffTime", 0.0))
        yaws_rad = _yaws_rad(heading, times_s, positions_m)
        program = base64.b64decode(lights["data"]) if lights else None
    return _checked(Drone(name, times_s, positions_m, yaws_rad, program))


def _part(archive: _Archive, settings: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a part of the settings of a drone, in place or from another file; empty without it."""
    part: dict[str, Any] = settings.get(name) or {}
    if "$ref" in part:
        part = _json(archive, part["$ref"].partition("#")[0])
    if part and part.get("version") != 1:
        raise ShowError(f"version {part.get('version')!r} of the {name}, only 1 is known")
    return part


def _yaws_rad(control: dict[str, Any], times_s: Array, positions_m: Array) -> Array:
    """Headings, which Skybrush counts clockwise in degrees: set points, or along the way where it moves."""
    at_s, clockwise_deg = np.array(control.get("setpoints") or [[0.0, 0.0]], dtype=float)[:, :2].T
    ways_m = np.diff(positions_m[:, :2], axis=0)
    moving = np.hypot(*ways_m.T) > SLOW_M_S * np.diff(times_s)
    if control.get("autoYaw") and moving.any():
        along_deg = np.degrees(np.unwrap(np.arctan2(ways_m[moving, 1], ways_m[moving, 0])))
        at_s, clockwise_deg = times_s[1:][moving], float(control.get("autoYawOffset", 0.0)) - along_deg
    if (np.diff(at_s) <= 0).any():
        raise ValueError("times of the headings must increase")
    return np.asarray(-np.radians(np.interp(times_s, at_s, clockwise_deg)))


def _sampled(points: Any) -> tuple[Array, Array]:
    """Times and positions along the keyframes; a fourth number of a point is left out."""
    (time_s, start, *_), *others = points
    times, positions = [float(time_s)], [start[:3]]
    for end_s, end, *further in others:
        points_inside = further[0] if further else []
        control = np.array([point[:3] for point in (start, *points_inside, end)], dtype=float)
        if control.shape[1:] != (3,) or len(control) > HIGHEST_DEGREE + 1:
            raise ValueError(f"at {end_s:g} s: no position, or more than {HIGHEST_DEGREE - 1} control points")
        if not time_s < end_s <= MAX_DURATION_S:
            raise ValueError(f"the keyframe at {end_s:g} s does not come after {time_s:g} s")
        steps = max(1, math.ceil((end_s - time_s) / STEP_S))
        further_s = np.linspace(time_s, end_s, steps + 1)[1:]
        times += further_s.tolist()
        positions += BPoly(control[:, np.newaxis], [time_s, end_s])(further_s).tolist()
        time_s, start = end_s, end
    return np.array(times), np.array(positions, dtype=float)


def _drone_of_csv(archive: _Archive, name: str) -> Drone:
    """Read `COLUMNS`, colours only if the first line names them; further ones are left out."""
    with errors_at(name, TextError):
        rows = list(rows_of(decoded(archive.read(name))))
        names = rows[0].cells if rows else [""]
        columns = COLUMNS[: 7 if [cell[:1].lower() for cell in names[4:7]] == ["r", "g", "b"] else 4]
        if not names[0].lstrip("+-.")[:1].isdigit():
            rows = rows[1:]
        table = np.array([_numbers(row, columns) for row in rows]).reshape(-1, len(columns))
    times_s, colours = 1e-3 * table[:, 0], table[:, 4:]
    if (np.abs(colours - 127.5) > 127.5).any():
        raise ShowError(f"{name}: colours are from 0 to 255")
    return _checked(Drone(name, times_s, table[:, 1:4], 0.0 * times_s, colours if colours.size else None))


def _numbers(row: Row, columns: Sequence[str]) -> list[float]:
    if len(row.cells) < len(columns):
        raise TextError(f"line {row.line}: needs the columns {', '.join(columns)}")
    return [number_in(cell, f"line {row.line}") for cell in row.cells[: len(columns)]]


def _checked(drone: Drone) -> Drone:
    name, times_s, positions_m, yaws_rad, _ = drone
    if len(times_s) < 2 or positions_m.shape != (len(times_s), 3):
        raise ShowError(f"{name}: at least two positions with x, y, z are needed")
    if not np.isfinite(np.column_stack((times_s, positions_m, yaws_rad))).all():
        raise ShowError(f"{name}: every number must be finite")
    if (np.diff(times_s) <= 0).any():
        raise ShowError(f"{name}: times must increase")
    return drone
