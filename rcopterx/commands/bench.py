"""Measuring speed, side by side with peers: `bench`."""

import json
from typing import Annotated, Any

import typer

from rcopterx.commands.numbers import different_numbers

app = typer.Typer(no_args_is_help=True)

COLUMNS = ("mean_ms", "p99_ms", "p999_ms", "max_ms", "error")


@app.callback()
def bench() -> None:
    """Measure speed, side by side with peers."""


@app.command()
def solver(
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON document.")] = False,
    horizons: Annotated[
        str, typer.Option(metavar="N,N,...", help="Horizons, in stages.")
    ] = "10,18,30,50,80,110",
    steps: Annotated[
        int | None, typer.Option(metavar="N", min=2, help="Control steps to measure per horizon.")
    ] = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Seed of the flight the steps come from.")
    ] = 0,
) -> None:
    """Whole control steps of the cascade, the paper's scheme and other solvers, on the same problems."""
    from benchmarks.solver import STEPS, run

    document = run(
        different_numbers(horizons, "--horizons", lowest=2, highest=200),
        STEPS if steps is None else steps,
        seed,
        lambda text: typer.echo(f"bench solver: {text}", err=True),
    )
    typer.echo(json.dumps(document, indent=2) if as_json else _readable(document))


def _readable(document: dict[str, Any]) -> str:
    """One line per horizon and solver."""
    lines = [f"{'N':>4}  {'solver':24}" + "".join(f"{column:>12}" for column in COLUMNS)]
    for horizon, solvers in document["horizons"].items():
        lines += [
            f"{horizon:>4}  {name:24}" + "".join(f"{_number(row[column]):>12}" for column in COLUMNS)
            for name, row in solvers.items()
        ]
    if document["missing"]:
        lines.append(f"not installed: {', '.join(document['missing'])}")
    return "\n".join(lines)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
