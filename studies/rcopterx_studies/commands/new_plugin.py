"""A package that adds a controller, an estimator or a vehicle type, from a template: `new-plugin`."""

import re
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final

import typer
from typer import Argument

from rcopterx.fleet.schema import FleetError

app = typer.Typer(add_completion=False)

TEMPLATES: Final = Path(__file__).parents[1] / "plugin_templates"
PLACEHOLDER: Final = "NAME"  # stands for the name in the templates and in the names of their files
SUFFIX: Final = ".template"


class Kind(StrEnum):
    """What a package can add."""

    CONTROLLER = "controller"
    ESTIMATOR = "estimator"
    VEHICLE_TYPE = "vehicle-type"


USED_BY: Final = {
    Kind.CONTROLLER: "rcopterx tune h2 --controller",
    Kind.ESTIMATOR: "rcopterx tune h2 --estimator",
    Kind.VEHICLE_TYPE: "rcopterx new-lab lab.toml    # type",
}


@app.command(rich_help_panel="Extend")
def new_plugin(
    kind: Annotated[Kind, Argument(help="What the package adds.")],
    name: Annotated[str, Argument(metavar="NAME", help="Lower case letters, digits and _.")],
) -> None:
    """Write a package with a controller, estimator or vehicle type of your own, and a test that flies it."""
    if (problem := _problem(kind, name)) is not None:
        raise FleetError(problem)
    templates = TEMPLATES / kind
    for template in sorted(templates.rglob(f"*{SUFFIX}")):
        relative = str(template.relative_to(templates)).removesuffix(SUFFIX)
        path = Path(name, relative.replace(PLACEHOLDER, name))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(template.read_text("utf-8").replace(PLACEHOLDER, name), "utf-8")
        typer.echo(path)
    typer.echo(f"next:\n    pip install -e '{name}[test]'\n    pytest {name}\n    {USED_BY[kind]} {name}")


def _problem(kind: Kind, name: str) -> str | None:
    """Why a name cannot be used; None if it can."""
    from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
    from rcopterx.fleet.vehicle_types import type_names

    known = {Kind.CONTROLLER: CONTROLLERS.available, Kind.ESTIMATOR: ESTIMATORS.available}.get(
        kind, type_names
    )
    if not re.fullmatch("[a-z][a-z0-9_]*", name):
        return f"{name!r} is no name: use lower case letters, digits and _"
    if name in known():
        return f"the {kind} {name!r} exists already"
    if find_spec(name) is not None:
        return f"{name!r} is the name of an installed module"
    return f"{name}: exists already and is not overwritten" if Path(name).exists() else None
