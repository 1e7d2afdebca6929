"""Flying faults in the simulator: `faults`."""

import fnmatch
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from rcopterx.commands.fleet_option import (
    DEFAULT_FLEET,
    EXIT_FAILED,
    LockstepOption,
    RecordOption,
    RunningFleetOption,
    SpeedOption,
)
from rcopterx.commands.fly import FlightOptions, ReportOption, flown_fleet
from rcopterx.commands.interruption import Interrupts
from rcopterx.commands.output import JsonOption, Progress, print_document

if TYPE_CHECKING:
    from rcopterx_studies.faults.bench import FaultFlight
    from rcopterx_studies.faults.flying import FaultRange

app = typer.Typer(add_completion=False)

UpOption = Annotated[bool, Option("--up", help="Start a fleet first.")]
VehiclesOption = Annotated[
    int | None, Option(metavar="N", min=1, help="With --up, fly the first N vehicles only.")
]
ADD_UP = "it needs a fleet of its own: add --up"


def chosen_faults(names: Sequence[str]) -> list["FaultFlight"]:
    """Rows of the table by their names or patterns such as `pair-*`, by default all."""
    from rcopterx_studies.faults.table import FAULT_FLIGHTS

    for name in names:
        if not fnmatch.filter(FAULT_FLIGHTS, name):
            raise typer.BadParameter(f"unknown fault flight {name!r}, see --list", param_hint="NAME")
    wanted = names or ["*"]
    return [row for row in FAULT_FLIGHTS.values() if any(fnmatch.fnmatch(row.name, name) for name in wanted)]


class FleetHolder:
    """The fleet that flies faults, or its first `vehicles`; started again after a loss, from a copy."""

    def __init__(self, options: FlightOptions, vehicles: int | None) -> None:
        self.options = options
        self._vehicles = vehicles
        self._stack = ExitStack()
        self._range: FaultRange | None = None
        self._file: Path | None = None
        self.interrupts = Interrupts()

    def fault_range(self, say: Callable[[str], None], file: Path | None = None) -> "FaultRange":
        """The fleet of a file, by default the chosen one, on the floor or in the air; `say` shows all."""
        from rcopterx.ground_station.scripting.observer import STARTED_S
        from rcopterx_studies.faults.bench import Bench, copied_fleet
        from rcopterx_studies.faults.flying import FaultRange

        if file != self._file:
            self.close()
        if self._range is None:
            self._file, options, path = file, self.options, None
            if options.start:
                name = str(file or options.fleet or DEFAULT_FLEET)
                path = self._stack.enter_context(copied_fleet(name, None if file else self._vehicles))
            fleet, self.interrupts = self._stack.enter_context(flown_fleet(options, str(path)))
            fleet.wait_ready(timeout_s=STARTED_S)
            self._range = FaultRange(Bench(fleet, say, fleet.wait, path))
        return self._range.saying(say)

    def close(self) -> None:
        """Land and stop the fleet if it was started here."""
        self._range = None
        self._stack.close()


@app.command(rich_help_panel="Try out faults")
def faults(
    names: Annotated[
        list[str] | None, Argument(metavar="NAME", help="Faults, or patterns such as 'pair-*'; see --list.")
    ] = None,
    fleet: RunningFleetOption = None,
    start: UpOption = False,
    report: ReportOption = None,
    as_json: JsonOption = False,
    show_list: Annotated[bool, Option("--list", help="List the faults and what is promised.")] = False,
    runs: Annotated[int, Option(metavar="N", min=1, help="Flights of each fault; the worst one counts.")] = 1,
    vehicles: VehiclesOption = None,
    record: RecordOption = True,
    speed: SpeedOption = None,
    lockstep: LockstepOption = False,
) -> None:
    """Fly faults, by default the whole table, and check what is promised. Exit code 1 if a promise broke.

    One fleet flies them while it survives. Ctrl-C lands.
    """
    from rcopterx_studies.faults.orders import obedient_processes
    from rcopterx_studies.faults.reports import worst_of

    rows = chosen_faults(names or [])
    if show_list:
        for row in rows:
            typer.echo(f"{row.name:32} {row.promise.value:18} {row.title}")
        return
    options = FlightOptions(fleet, start, record, report, as_json, speed, lockstep)
    options.prepare()
    reports: list[dict[str, Any]] = []
    obedient = obedient_processes() if start else nullcontext()
    with obedient, closing(FleetHolder(options, vehicles)) as holder:
        try:
            for number, row in enumerate(rows, 1):
                head = f"[{number}/{len(rows)}] {row.name}"
                heads = [head] if runs == 1 else [f"{head} ({run}/{runs})" for run in range(1, runs + 1)]
                reports.append(worst_of([_fly_row(row, holder, head) for head in heads]))
        finally:
            _write(reports, report)
    print_document(reports, as_json, lambda rows: "\n".join(map(_line, rows)))
    if any(one["verdict"] == "failed" for one in reports):
        raise typer.Exit(EXIT_FAILED)


def _fly_row(row: "FaultFlight", holder: FleetHolder, head: str) -> dict[str, Any]:
    from rcopterx.ground_station.scripting.waiting import stopped_by
    from rcopterx_studies.faults.reports import not_flown

    say = Progress(head).say
    if row.fleet is not None and not holder.options.start:
        return not_flown(row, ADD_UP)
    place = holder.fault_range(say, row.fleet)
    reason = None if holder.options.start else ADD_UP
    if place.fleet.file.clock.lockstep:
        reason = "it breaks processes, for which lockstep waits"
    if row.launched and reason is not None:
        say(f"not flown: {reason}")
        return not_flown(row, reason)
    with stopped_by(holder.interrupts):
        report = place.fly(row)
    say(report["verdict"])
    if not place.survives(row, report):
        holder.close()
    return report


def _write(reports: Sequence[dict[str, Any]], directory: Path | None) -> None:
    from rcopterx_studies.faults.matrix import write_reports

    flown = [report for report in reports if report["verdict"] != "not flown"]
    if directory is not None and flown:
        typer.echo(f"page: {write_reports(flown, directory)}", err=True)


def _line(report: dict[str, Any]) -> str:
    failed = [f"{check['name']}: {check['figure']}" for check in report["checks"] if not check["passed"]]
    why = report["problem"] or "; ".join(failed) or report["seen"]
    return f"{report['verdict']:9} {report['name']:32} {why}".rstrip()
