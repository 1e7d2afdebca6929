"""Reproducing the paper's figures: `experiment`."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcopterx.commands.output import JsonOption, PlotOption, Progress, check_plot, print_document, write_plot
from rcopterx.commands.parsing import check_known, different_numbers
from rcopterx.simulator.conditions import PRESETS

if TYPE_CHECKING:
    from rcopterx.experiments.knowledge import Knowledge
    from rcopterx.experiments.runner import Experiment

QUICK_SEEDS = 2
REAL_FLIGHTS = "real-flights"


def experiment(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of an experiment, see --list.")] = "",
    flights: Annotated[
        Path | None,
        typer.Argument(metavar="DIRECTORY", help="Recorded flights (.csv, .csv.gz), for real-flights."),
    ] = None,
    as_json: JsonOption = False,
    plot: PlotOption = None,
    seeds: Annotated[
        str | None, typer.Option(metavar="N,N,...", help="Seeds, one flight each. Default: consecutive ones.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Short flights, as a test.")] = False,
    processes: Annotated[int, typer.Option(metavar="N", min=1, help="Processor cores to use.")] = 1,
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
            help="Models that the pilots have of their vehicles: default, identified, exact. Default: all.",
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Store finished flights in this file, and skip those that it has."),
    ] = None,
    show_list: Annotated[bool, typer.Option("--list", help="List the experiments.")] = False,
) -> None:
    """Fly an experiment of the paper in simulation, faster than real time, and print its figures."""
    from rcopterx.experiments.catalogue import EXPERIMENTS
    from rcopterx.experiments.kept import KeptFlights, KeptFlightsError
    from rcopterx.experiments.runner import Options
    from rcopterx.simulator.identified_crazyflie import missing_library

    if show_list:
        for row in EXPERIMENTS.values():
            typer.echo(f"{row.name:12} {row.title}")
        typer.echo(f"{REAL_FLIGHTS:12} Estimators and models on flights that others recorded")
        return
    check_known([name], [*EXPERIMENTS, REAL_FLIGHTS], "experiment", "NAME")
    if (flights is not None) != (name == REAL_FLIGHTS):
        raise typer.BadParameter(f"{REAL_FLIGHTS} needs a directory, others take none")
    if flights is not None:
        _judge(flights, plot, as_json)
        return
    chosen = EXPERIMENTS[name]
    presets = list(chosen.flights) if conditions is None else [conditions]
    check_known(presets, PRESETS, "preset", "--conditions")
    for preset in presets:
        if (missing := missing_library(PRESETS[preset])) is not None:
            raise typer.BadParameter(f"{preset}: {missing}", param_hint="--conditions")
    numbers = None if seeds is None else different_numbers(seeds, "--seeds")
    levels = _levels(knowledge, chosen)
    _check_figure(chosen, plot)
    documents, progress = {}, Progress(name)
    for preset in presets:
        try:
            context = {"experiment": name, "conditions": preset, "quick": quick}
            kept = None if resume is None else KeptFlights(resume, context)
            flown = numbers or chosen.seeds(preset)[: QUICK_SEEDS if quick else None]
            options = Options(flown, quick, processes, preset, kept, levels)
            result = chosen.fly(options, lambda label, done: progress.show(label, f", {100 * done:.0f} %"))
            progress.say("flown")
        except KeptFlightsError as error:
            raise typer.BadParameter(str(error), param_hint="--resume") from None
        documents[preset] = result.document
        if plot is not None and chosen.draw is not None:
            path = plot if len(presets) == 1 else plot.with_stem(f"{plot.stem}_{preset}")
            write_plot(partial(chosen.draw, result), path)
    print_document(documents if len(presets) > 1 else documents[presets[0]], as_json)


def _judge(directory: Path, plot: Path | None, as_json: bool) -> None:
    from rcopterx.experiments.real_flights import judge, read_flights

    check_plot(plot)
    try:
        found, unusable = read_flights(directory)
        evidence = judge(list(found.values()))
    except (ValueError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="DIRECTORY") from None
    if plot is not None:
        write_plot(evidence.draw, plot)
    print_document({"flights": list(found), "unusable": unusable} | evidence.document(), as_json)


def _check_figure(row: "Experiment[Any]", plot: Path | None) -> None:
    check_plot(plot)
    if plot is not None and row.draw is None:
        raise typer.BadParameter(f"{row.name} has no figure", param_hint="--plot")


def _levels(chosen: str | None, row: "Experiment[Any]") -> "tuple[Knowledge, ...]":
    """Levels of knowledge that the command names, in the usual order; all by default."""
    from rcopterx.experiments.knowledge import LEVELS

    if chosen is None:
        return LEVELS
    if not row.compares_knowledge:
        raise typer.BadParameter(f"{row.name} does not compare it", param_hint="--knowledge")
    names = [name.strip() for name in chosen.split(",")]
    check_known(names, LEVELS, "level", "--knowledge")
    return tuple(level for level in LEVELS if level in names)
