"""Measuring speed, side by side with peers: `bench`."""

from functools import partial
from typing import Annotated, Any

import typer

from rcopterx.commands.fleet_option import SpeedOption
from rcopterx.commands.output import JsonOption, PlotOption, Progress, print_document, write_plot
from rcopterx_studies.commands.options import different_numbers

app = typer.Typer(no_args_is_help=True, add_completion=False)

COLUMNS = ("mean_ms", "p99_ms", "p999_ms", "max_ms", "error")


@app.callback(rich_help_panel="Experiment")
def bench() -> None:
    """Measure speed, side by side with peers."""


@app.command()
def solver(
    as_json: JsonOption = False,
    horizons: Annotated[str, typer.Option(metavar="N,N,...", help="Horizons N.")] = "10,18,30,50,80,110",
    steps: Annotated[int, typer.Option(metavar="N", min=2, help="Control steps per horizon.")] = 2000,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the recorded flight.")] = 0,
    plot: PlotOption = None,
) -> None:
    """Time control steps of the cascade, the paper's scheme and other solvers on the same problems."""
    from rcopterx_studies.benchmarks.solver import draw_solver, run

    lengths = different_numbers(horizons, "--horizons", lowest=2, highest=200)
    document = run(lengths, steps, seed, Progress("bench solver").say)
    write_plot(partial(draw_solver, document), plot)
    print_document(document, as_json, _solver_lines)


def _solver_lines(document: dict[str, Any]) -> str:
    lines = [f"{'N':>4}  {'solver':24}" + "".join(f"{column:>12}" for column in COLUMNS)]
    for horizon, solvers in document["horizons"].items():
        for name, row in solvers.items():
            numbers = ("-" if row[column] is None else f"{row[column]:.3g}" for column in COLUMNS)
            lines.append(f"{horizon:>4}  {name:24}" + "".join(f"{number:>12}" for number in numbers))
    if document["missing"]:
        lines.append(f"not installed: {', '.join(document['missing'])}")
    return "\n".join(lines)


@app.command()
def scale(
    as_json: JsonOption = False,
    vehicles: Annotated[
        str, typer.Option(metavar="N,N,...", help="Numbers of vehicles.")
    ] = "3,6,8,10,12,14,16",
    horizon: Annotated[int, typer.Option(metavar="N", min=2, max=200, help="Stages N.")] = 30,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=1, max=3600, help="Duration of each flight.")
    ] = 60.0,
    rate: Annotated[
        float,
        typer.Option(
            metavar="HZ", min=50, max=400, help="Frame rate of the simulated Tracker; control stays 50 Hz."
        ),
    ] = 50.0,
    speed: SpeedOption = None,
    plot: PlotOption = None,
) -> None:
    """Fly fleets of growing size on this computer: missed control periods, pose to command, load.

    In slow motion (`--speed`) all times are those of the fleet, so that larger fleets can be measured.
    """
    from rcopterx_studies.benchmarks.scale import Series, draw_scale, run, scale_table

    sizes = different_numbers(vehicles, "--vehicles", lowest=1, highest=128)
    document = run(sizes, Series(horizon, seconds, rate, speed or 1.0), Progress("bench scale").say)
    write_plot(partial(draw_scale, document), plot)
    print_document(document, as_json, scale_table)
