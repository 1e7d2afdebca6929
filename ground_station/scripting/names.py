"""Names of vehicles as arguments of the scripting interface."""

from collections.abc import Iterable

from rcopterx.fleet.schema import FleetFile


def named(file: FleetFile, names: Iterable[str]) -> list[str]:
    """Return the named vehicles, or the one that a text names; KeyError if the fleet has none of a name."""
    vehicles = [names] if isinstance(names, str) else list(names)
    for name in vehicles:
        if name not in file.vehicles:
            raise KeyError(f"no vehicle {name!r}, known are {', '.join(file.vehicles)}")
    return vehicles
