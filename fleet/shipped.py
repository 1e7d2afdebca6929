"""Fleet files that come with the package."""

from importlib.resources import as_file, files
from pathlib import Path

from rcopterx.fleet.schema import FleetError


def shipped_fleets() -> dict[str, Path]:
    """Return the fleet files that come with the package, by name."""
    with as_file(files("rcopterx.deploy") / "fleets") as directory:
        return {path.stem: path for path in sorted(directory.glob("*.toml"))}


def fleet_path(name: str) -> Path:
    """Return the path of a fleet file, or of a shipped fleet by its name.

    Raises `FleetError`: there is neither such a file nor such a shipped fleet.
    """
    path = Path(name)
    if path.exists():
        return path
    shipped = shipped_fleets()
    # Paths of the source tree also name shipped files, so that examples in the documentation work anywhere.
    if name in shipped or (path.suffix == ".toml" and path.parent.name == "fleets" and path.stem in shipped):
        return shipped[path.stem]
    raise FleetError(f"{name}: no such file; shipped fleets are {', '.join(shipped)}")
