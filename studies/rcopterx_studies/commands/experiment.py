"""Reproducing the paper's figures: `experiment`."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcopterx.commands.fleet_option import ColumnsOption
from rcopterx.commands.output import JsonOption, PlotOption, Progress, print_document, write_plot
from rcopterx.commands.parsing import check_known
from rcopterx.simulator.conditions import FIRST_ORDER, PRESETS
from rcopterx_studies.commands.options import (
    ProcessesOption,
    QuickOption,
    ResumeOption,
    different_numbers,
    known_names,
    shares_on,
)

if TYPE_CHECKING:
    from rcopterx_studies.experiments.knowledge import Knowledge
    from rcopterx_studies.experiments.runner import Experiment

QUICK_SEEDS = 2
REAL_FLIGHTS = "real-flights"
REAL_FLIGHTS_TITLE = "Estimators and models on flights that others recorded"

app = typer.Typer(add_completion=False)


@app.command(rich_help_panel="Experiment")
def experiment(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of an experiment, see --list.")] = "",
    flights: Annotated[
        Path | None,
        typer.Argument(
            metavar="DIRECTORY",
            help="Recorded flights (.csv, .csv.gz), for real-flights; with --columns one.",
        ),
    ] = None,
    columns: ColumnsOption = None,
    as_json: JsonOption = False,
    plot: PlotOption = None,
    seeds: Annotated[
        str | None, typer.Option(metavar="N,N,...", help="Seeds, one flight each. Default: consecutive ones.")
    ] = None,
    quick: QuickOption = False,
    processes: ProcessesOption = 1,
    conditions: Annotated[
        str | None,
        typer.Option(
            metavar="PRESET",
            help=f"Conditions of the laboratory: {', '.join(PRESETS)}. Default: those of the experiment.",
        ),
    ] = None,
    knowledge: Annotated[
        str | None,
        typer.Option(
            metavar="LEVEL,...",
            help="Models that the pilots have of their vehicles: default, identified, exact; in fleets "
            "learned, too. Default: all.",
        ),
    ] = None,
    resume: ResumeOption = None,
    show_list: Annotated[bool, typer.Option("--list", help="List the experiments.")] = False,
) -> None:
    """Fly an experiment of the paper in simulation, faster than real time, and print its figures."""
    from rcopterx_studies.experiments.catalogue import EXPERIMENTS
    from rcopterx_studies.experiments.kept import KeptFlights
    from rcopterx_studies.experiments.runner import Options

    if show_list:
        titles = {row.name: row.title for row in EXPERIMENTS.values()} | {REAL_FLIGHTS: REAL_FLIGHTS_TITLE}
        typer.echo("\n".join(f"{row:12} {title}" for row, title in titles.items()))
        return
    check_known([name], [*EXPERIMENTS, REAL_FLIGHTS], "experiment", "NAME")
    if (flights is not None) != (name == REAL_FLIGHTS):
        raise typer.BadParameter(f"{REAL_FLIGHTS} needs a directory, others take none")
    if columns is not None and flights is not None:
        _predict_rest(flights, columns, as_json)
        return
    if flights is not None:
        _judge(flights, plot, as_json)
        return
    chosen = EXPERIMENTS[name]
    presets = _presets(chosen, conditions)
    numbers = None if seeds is None else different_numbers(seeds, "--seeds")
    levels = _levels(knowledge, chosen)
    if plot is not None and chosen.draw is None:
        raise typer.BadParameter(f"{name} has no figure", param_hint="--plot")
    documents, progress = {}, Progress(name)
    for preset in presets:
        flown = numbers or chosen.seeds(preset)[: QUICK_SEEDS if quick else None]
        context = {"experiment": name, "conditions": preset, "quick": quick}
        kept = None if resume is None else KeptFlights(resume, context)
        result = chosen.fly(Options(flown, quick, processes, preset, kept, levels), shares_on(progress))
        progress.say("flown")
        documents[preset] = result.document
        if plot is not None and chosen.draw is not None:
            stem = plot.stem if len(presets) == 1 else f"{plot.stem}_{preset}"
            write_plot(partial(chosen.draw, result), plot.with_stem(stem))
    print_document(documents if len(presets) > 1 else documents[presets[0]], as_json)


def _judge(directory: Path, plot: Path | None, as_json: bool) -> None:
    from rcopterx_studies.experiments.real_flights import judge, read_flights

    try:
        found, unusable = read_flights(directory)
        evidence = judge(list(found.values()))
    except (ValueError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="DIRECTORY") from None
    if plot is not None:
        write_plot(evidence.draw, plot)
    print_document({"flights": list(found), "unusable": unusable} | evidence.document(), as_json)


def _predict_rest(path: Path, columns: Path, as_json: bool) -> None:
    from rcopterx.fleet.vehicle_types import vehicle_type
    from rcopterx_studies.experiments.flight_csv import read_columns, read_mapped
    from rcopterx_studies.experiments.real_flights import predict_rest

    try:
        named = read_columns(columns)
        known = vehicle_type(named.type).model
        document = predict_rest(read_mapped(path, known.kind, named), known)
    except (ValueError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="DIRECTORY") from None
    print_document(document, as_json)


def _presets(row: "Experiment[Any]", conditions: str | None) -> list[str]:
    """Conditions to fly under, which this computer can simulate."""
    from rcopterx.simulator.plant import added_plant
    from rcopterx_studies.experiments.knowledge import COAXIAL, plant_type

    presets = list(row.flights) if conditions is None else [conditions]
    check_known(presets, PRESETS, "preset", "--conditions")
    for preset in presets:
        if (plant := PRESETS[preset].attitude_plant) != FIRST_ORDER:
            try:
                added_plant(plant)
            except ValueError as error:
                raise typer.BadParameter(f"{preset}: {error}", param_hint="--conditions") from None
        if row.helicopters_only and plant_type(PRESETS[preset]) is not COAXIAL:
            raise typer.BadParameter(f"{preset}: no helicopters fly there", param_hint="--conditions")
    return presets


def _levels(chosen: str | None, row: "Experiment[Any]") -> "tuple[Knowledge, ...]":
    """Levels of knowledge that the command names, in the usual order; all of the experiment by default."""
    if chosen is None:
        return row.levels
    if not row.levels:
        raise typer.BadParameter(f"{row.name} does not compare it", param_hint="--knowledge")
    names = known_names(chosen, row.levels, "level", "--knowledge")
    return tuple(level for level in row.levels if level in names)
