"""A package of one's own, from a template: `new-plugin`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument

app = typer.Typer(add_completion=False)


class Kind(StrEnum):
    """What a package can add."""

    CONTROLLER = "controller"
    ESTIMATOR = "estimator"
    VEHICLE_TYPE = "vehicle-type"


USED_BY = {
    Kind.CONTROLLER: "rcopterx tune h2 --controller",
    Kind.ESTIMATOR: "rcopterx tune h2 --estimator",
    Kind.VEHICLE_TYPE: "rcopterx new-lab lab.toml --type",
}


@app.command(rich_help_panel="Extend")
def new_plugin(
    kind: Annotated[Kind, Argument(help="What the package adds.")],
    name: Annotated[str, Argument(metavar="NAME", help="Lower case letters, digits and _.")],
) -> None:
    """Write a package with a controller, estimator or vehicle type of your own, and a test that flies it."""
    from rcopterx_studies.new_package.writing import write_package

    written = write_package(kind, name, Path())
    for path in written:
        typer.echo(path)
    typer.echo(f"next:\n    pip install -e '{name}[test]'\n    pytest {name}\n    {USED_BY[kind]} {name}")
