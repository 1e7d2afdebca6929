"""A copy of a fleet file that fault flights may damage, with a battery that outlasts them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import tomlkit

from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.fleet.schema import FleetError

ENDURANCE_S: Final = 36_000.0  # of the simulated batteries, because one fleet flies many faults


@contextmanager
def copied_fleet(name: str, vehicles: int | None = None) -> Iterator[Path]:
    """Path of a copy of a fleet file, or of a shipped one, that is deleted afterwards.

    With `vehicles` it has only the first ones of the fleet. Raises `FleetError`: it cannot be used, or has no
    simulated laboratory.
    """
    path = fleet_path(name)
    if load_fleet(path).simulator is None:
        raise FleetError(f"{path}: faults are flown in the simulator only, and [simulator] is missing")
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    for vehicle in list(document["vehicles"])[vehicles:] if vehicles else ():
        del document["vehicles"][vehicle]
    simulator = document["simulator"]
    overrides = dict(simulator.get("condition_overrides", {}))
    simulator["condition_overrides"] = {**overrides, "battery_endurance_s": ENDURANCE_S}
    with TemporaryDirectory(prefix="rcopterx-faults-") as directory:
        copy = Path(directory) / path.name
        copy.write_text(tomlkit.dumps(document), encoding="utf-8")
        yield copy
