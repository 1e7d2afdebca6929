"""Fleet files that come with the package, and the one that is meant by a name."""

from importlib.resources import as_file, files
from pathlib import Path

from rcopterx.fleet.schema import FleetError


def shipped_fleets() -> dict[str, Path]:
    """Fleet files that come with the package, by name."""
    with as_file(files("rcopterx.deploy") / "fleets") as directory:
        return {path.stem: path for path in sorted(directory.glob("*.toml"))}


def fleet_path(name: str) -> Path:
    """Path of a fleet file or of a shipped fleet.

    Raises
    ------
    FleetError
        Neither a file nor a shipped fleet.
    """
    path = Path(name)
    if path.exists():
        return path
    shipped = shipped_fleets()
    # A path of the source tree also names the shipped file, so that documentation holds in any directory.
    if name in shipped or (path.suffix == ".toml" and path.parent.name == "fleets" and path.stem in shipped):
        return shipped[path.stem]
    raise FleetError(f"{name}: no such file; shipped fleets are {', '.join(shipped)}")
