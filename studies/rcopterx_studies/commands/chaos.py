"""Flying random faults: `chaos`."""

import json
from typing import Annotated

import typer
from typer import Option

from rcopterx.commands.fleet_option import EXIT_FAILED, RunningFleetOption, SpeedOption
from rcopterx.commands.fly import FlightOptions, ReportOption, UpOption
from rcopterx.commands.launch import RecordOption
from rcopterx.commands.output import JsonOption, Progress, print_document
from rcopterx_studies.commands.faults import VehiclesOption, fleet_holder

app = typer.Typer(add_completion=False)


@app.command(rich_help_panel="Try out faults")
def chaos(
    fleet: RunningFleetOption = None,
    start: UpOption = False,
    report: ReportOption = None,
    as_json: JsonOption = False,
    seconds: Annotated[float, Option(metavar="SECONDS", min=1, help="Duration.")] = 600.0,
    seed: Annotated[int, Option(min=0, help="Seed of the faults.")] = 0,
    vehicles: VehiclesOption = None,
    busy: Annotated[
        int,
        Option(
            metavar="N",
            min=0,
            help="Busy processes beside the fleet. With any, all processors are also taken at real-time "
            "priority for 0.3 s every 4 s.",
        ),
    ] = 0,
    record: RecordOption = True,
    speed: SpeedOption = None,
) -> None:
    """Inject a random fault every 2 to 4 s, which all vehicles shall survive. Exit code 1 if one does not.

    Ctrl-C lands.
    """
    from rcopterx.ground_station.scripting.waiting import NotReachedError, stopped_by
    from rcopterx_studies.faults.chaos import Chaos

    options = FlightOptions(fleet, start, record, report, as_json, speed)
    options.prepare()
    with fleet_holder(options, vehicles) as holder:
        place = holder.fault_range(Progress(f"chaos {seed}").say)
        if place.fleet.launcher is None:
            raise NotReachedError("chaos ends processes, so it needs a fleet of its own: add --up")
        with stopped_by(holder.interrupts):
            result = Chaos(place, seed, seconds, busy).fly()
    if report is not None:
        path = report / f"chaos-{seed}.json"
        path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        typer.echo(f"report: {path}", err=True)
    print_document(result, as_json)
    if result["verdict"] != "passed":
        raise typer.Exit(EXIT_FAILED)
