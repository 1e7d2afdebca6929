"""Comparing schemes: `arena`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rcopterx.commands.output import JsonOption, Progress, print_document
from rcopterx.commands.parsing import check_known
from rcopterx_studies.commands.options import (
    ProcessesOption,
    QuickOption,
    ResumeOption,
    different_numbers,
    known_names,
    shares_on,
)

app = typer.Typer(add_completion=False)


@app.command(rich_help_panel="Experiment")
def arena(
    schemes: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...", help="Schemes and controllers, see --list. Default: the usual ones."
        ),
    ] = None,
    tasks: Annotated[str | None, typer.Option(metavar="NAME,...", help="Default: all.")] = None,
    as_json: JsonOption = False,
    page: Annotated[
        Path | None, typer.Option(metavar="DIRECTORY", help="Write a page with pictures there.")
    ] = None,
    seeds: Annotated[
        str, typer.Option(metavar="N,N,...", help="Seeds of vehicles, weather and losses, one flight each.")
    ] = "100",
    conditions: Annotated[
        str, typer.Option(metavar="PRESET", help="Conditions, as of experiments.")
    ] = "helicopters",
    processes: ProcessesOption = 1,
    resume: ResumeOption = None,
    quick: QuickOption = False,
    show_list: Annotated[bool, typer.Option("--list", help="List schemes and tasks.")] = False,
) -> None:
    """Fly schemes of distributed control on the same tasks, and compare them."""
    from rcopterx.control.plugins import SettingsError
    from rcopterx.simulator.conditions import PRESETS
    from rcopterx_studies.arena.arena import DEFAULT_SCHEMES, arena, digest, error_ratios, foreign_digests
    from rcopterx_studies.arena.flying import arena_schemes
    from rcopterx_studies.arena.page import write_arena
    from rcopterx_studies.arena.tasks import TASKS
    from rcopterx_studies.experiments.kept import KeptFlights
    from rcopterx_studies.experiments.runner import Options

    if show_list:
        typer.echo(f"schemes: {', '.join(arena_schemes())}")
        for task in TASKS.values():
            typer.echo(f"{task.name:14} {task.title}")
        return
    chosen = (
        DEFAULT_SCHEMES if schemes is None else known_names(schemes, arena_schemes(), "scheme", "--schemes")
    )
    flown = tuple(TASKS) if tasks is None else known_names(tasks, TASKS, "task", "--tasks")
    check_known([conditions], PRESETS, "preset", "--conditions")
    numbers, progress = different_numbers(seeds, "--seeds"), Progress("arena")
    packages = foreign_digests(chosen)
    context = {"conditions": conditions, "quick": quick, "packages": packages}
    kept = None if resume is None else KeptFlights(resume, context)
    try:
        options = Options(numbers, quick, processes, conditions, kept)
        result = arena(chosen, flown).fly(options, shares_on(progress))
    except SettingsError as error:
        raise typer.BadParameter(str(error), param_hint="--schemes") from None
    ratios = error_ratios(result.flown, flown, chosen)
    document = {"digest": digest(result.document), "tasks": result.document, "ratios": ratios}
    if page is not None:
        typer.echo(f"page: {write_arena(page, result)}", err=True)
    print_document(document, as_json, _text)


def _text(document: dict[str, Any]) -> str:
    """A line for each task and scheme, best first, ratios with their intervals, and the digest."""
    from rcopterx_studies.arena.page import ranked

    columns = ("rms", "max", "task rms", "closest", "violated", "messages", "kB/s")
    lines = [f"{'task':14} {'scheme':16}" + "".join(f" {column:>9}" for column in columns) + " lost"]
    for task, rows in document["tasks"].items():
        for scheme, row in ranked(rows):
            numbers = (
                row["rms_mm"], row["max_mm"], row["task_rms_mm"], row["closest_mm"], row["violated_s"],
                row["messages_per_s"], row["bytes_per_s"] / 1000.0,
            )  # fmt: skip
            lost = sum(map(len, row["lost"].values()))
            lines.append(f"{task:14} {scheme:16}" + "".join(f" {one:9.1f}" for one in numbers) + f" {lost:4}")
    for task, by_scheme in document["ratios"].items():
        for scheme, row in by_scheme.items():
            rms, largest = (_interval(row[name]) for name in ("rms", "max"))
            lines.append(f"{task:14} {scheme:16} times the first scheme's error: rms {rms}, max {largest}")
    return "\n".join([*lines, f"digest {document['digest']}"])


def _interval(ratio: dict[str, Any]) -> str:
    low, high = ratio["median_95%"]
    return f"{ratio['median']:g} ({low:g} to {high:g})"
