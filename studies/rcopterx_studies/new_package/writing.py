"""Packages that add a controller, an estimator or a vehicle type, written from templates."""

import re
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.vehicle_types import type_names

NAMES_OF_KIND: Final[Mapping[str, Callable[[], list[str]]]] = {
    "controller": CONTROLLERS.available,
    "estimator": ESTIMATORS.available,
    "vehicle-type": type_names,
}
"""Names that exist already, by what a package can add."""
TEMPLATES: Final = Path(__file__).parent
PLACEHOLDER: Final = "NAME"  # stands for the name in the templates and in the names of their files
SUFFIX: Final = ".template"


def write_package(kind: str, name: str, parent: Path) -> list[Path]:
    """Write the package `name` below `parent`; return its files. `FleetError` for an unusable name."""
    directory = parent / name
    if not re.fullmatch("[a-z][a-z0-9_]*", name):
        raise FleetError(f"{name!r} is no name: use lower case letters, digits and _")
    if name in NAMES_OF_KIND[kind]():
        raise FleetError(f"the {kind} {name!r} exists already")
    if find_spec(name) is not None:
        raise FleetError(f"{name!r} is the name of an installed module")
    if directory.exists():
        raise FleetError(f"{directory}: exists already and is not overwritten")
    written = []
    templates = TEMPLATES / kind
    for template in sorted(templates.rglob(f"*{SUFFIX}")):
        relative = str(template.relative_to(templates)).removesuffix(SUFFIX)
        path = directory / relative.replace(PLACEHOLDER, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(template.read_text("utf-8").replace(PLACEHOLDER, name), "utf-8")
        written.append(path)
    return written
