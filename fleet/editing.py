"""Writes calibrations and models into a fleet file; comments stay, and the file is replaced as a whole."""

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import tomlkit

from rcopterx.fleet.radios import calibration_of
from rcopterx.fleet.reading import SUFFIX, load_fleet, parse_fleet, shipped_fleets, text_of
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.places import replace_file
from rcopterx.radios.calibration import Calibration
from rcopterx.vehicles.model import Model, fitted_parameters


def write_calibration(path: Path, vehicle: str, calibration: Calibration) -> list[str]:
    """Change a vehicle's calibration; return a line for each changed field. `FleetError`: nothing written."""
    keys, after = ("vehicles", vehicle, "transmitter", "calibration"), msgspec.to_builtins(calibration)
    return _rewrite(
        path, keys, lambda file: msgspec.to_builtins(calibration_of(file, vehicle)), after, inline=True
    )


def write_model(path: Path, vehicle: str, model: Model) -> list[str]:
    """Change a model's `FITTED` fields, rounded to `DIGITS`; return lines of changes, or `FleetError`."""
    keys, after = ("vehicles", vehicle, "model"), fitted_parameters(model)
    return _rewrite(path, keys, lambda file: fitted_parameters(model_of(file, vehicle)), after, inline=False)


def _rewrite(
    path: Path,
    keys: Sequence[str],
    present: Callable[[FleetFile], Mapping[str, Any]],
    after: Mapping[str, Any],
    *,
    inline: bool,
) -> list[str]:
    """Change `present` in a fleet file to `after`, return the changes; a missing table is created."""
    path = _own(path)
    before, document = present(load_fleet(path)), tomlkit.parse(text_of(path))
    table: Any = document
    for key in keys:
        table = table.setdefault(key, tomlkit.inline_table() if inline else tomlkit.table())
    new = not table
    if not (lines := _set_numbers(table, before, after, "", complete=inline)):
        return []
    if new and not inline:
        table.add(tomlkit.nl())
    changed = tomlkit.dumps(document)
    if present(parse_fleet(changed, path.parent)) != after:
        raise FleetError(f"{path}: {'.'.join(keys)} cannot be changed by a program")
    _replace(path, changed)
    return lines


def _set_numbers(
    table: MutableMapping[str, Any],
    before: Mapping[str, Any] | None,
    after: Mapping[str, Any],
    where: str,
    complete: bool = False,
) -> list[str]:
    """Set what changes, and everything in new inner tables if they have to be `complete`."""
    lines = []
    for name, new in after.items():
        old = None if before is None else before[name]
        if old == new:
            continue
        if isinstance(new, dict):
            if name not in table:
                table[name] = tomlkit.inline_table()
                table[name].update(new if complete else {})
            lines += _set_numbers(table[name], old, new, f"{where}{name}.")
        else:
            table[name] = new
            lines.append(f"{where}{name}: {_text(old)} -> {_text(new)}")
    return lines


def _text(value: Any) -> str:
    return f"[{', '.join(f'{number:g}' for number in value)}]" if isinstance(value, list) else f"{value:g}"


def _own(path: Path) -> Path:
    """Return the resolved path of a fleet file that does not come with the package, and is no snapshot."""
    path = path.resolve()
    if path.suffix == SUFFIX:
        raise FleetError(f"{path}: a snapshot is not changed; name the fleet file (TOML)")
    if path in (shipped.resolve() for shipped in shipped_fleets().values()):
        raise FleetError(f"{path}: comes with the package and is not changed; copy it and use the copy")
    return path


def check_own(path: Path) -> None:
    """Check that a fleet file can be read and changed."""
    load_fleet(_own(path))


def _replace(path: Path, text: str) -> None:
    line_end, mode = "\r\n" if b"\r\n" in path.read_bytes() else "\n", path.stat().st_mode & 0o7777
    replace_file(path, text.replace("\n", line_end).encode(), mode)
    path.chmod(mode)
