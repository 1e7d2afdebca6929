"""Flying manoeuvres: `fly`."""

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer import Option

from rcopterx.commands.fleet_option import (
    EXIT_FAILED,
    LockstepOption,
    RecordOption,
    RunningFleetOption,
    SpeedOption,
    fleet_file,
    running_fleet,
)
from rcopterx.commands.interruption import Interrupts
from rcopterx.commands.launch import interruptible
from rcopterx.commands.output import JsonOption, Progress, print_document
from rcopterx.commands.parsing import check_known
from rcopterx.places import try_place

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile
    from rcopterx.ground_station.acceptance.flight import Manoeuvre
    from rcopterx.ground_station.report.recorder import Recording
    from rcopterx.ground_station.scripting.fleet import Fleet

FLIGHT_NAME: Final = "flight.html"  # page that plays a flight, beside its report
SLICE_S = 0.25  # between two updates of the progress


ReportOption = Annotated[Path | None, Option(metavar="DIR", help="Write reports and a page here.")]


@dataclass(frozen=True)
class FlightOptions:
    """Fleet and outputs of flights that a command judges."""

    fleet: str | None
    start: bool  # start the fleet first, stop it afterwards
    record: bool
    report: Path | None  # directory of the reports
    as_json: bool
    speed: float | None = None  # how fast the time of a started fleet passes, if not as in its file
    lockstep: bool = False  # whether a started fleet waits for all its processes

    def prepare(self) -> None:
        """Make the directory of the reports, if any; refuse before the flight what will fail."""
        if (self.speed is not None or self.lockstep) and not self.start:
            raise typer.BadParameter("a running fleet keeps its speed; add --up", param_hint="--speed")
        if self.report is None:
            return
        try:
            self.report.mkdir(parents=True, exist_ok=True)
            try_place(self.report)
        except OSError as error:
            raise typer.BadParameter(f"{self.report}: {error.strerror}", param_hint="--report") from None


@contextmanager
def flown_fleet(options: FlightOptions, path: str) -> Iterator[tuple["Fleet", Interrupts]]:
    """Join the fleet that is up, or start that of a file, which lands and stops at the end."""
    from rcopterx.bus.processes import SCRIPT

    if options.start:
        file = fleet_file(path, options.speed, options.lockstep)
        with interruptible(file, None, record=options.record, script=SCRIPT) as started:
            yield started
    else:
        with running_fleet(options.fleet) as fleet:
            yield fleet, Interrupts()


def fly(
    names: list[str] | None = None,
    fleet: RunningFleetOption = None,
    start: bool = False,
    every: bool = False,
    report: ReportOption = None,
    as_json: JsonOption = False,
    show_list: bool = False,
    record: RecordOption = True,
    speed: SpeedOption = None,
    lockstep: LockstepOption = False,
) -> None:
    """Fly manoeuvres, check them, and write a report. Exit code 1 if a check failed. Ctrl-C lands."""
    from rcopterx.ground_station.acceptance.manoeuvres import MANOEUVRES

    if show_list:
        for row in MANOEUVRES.values():
            typer.echo(f"{row.name:24} {row.title}")
        return
    rows = _chosen(names or [], every)
    options = FlightOptions(fleet, start, record, report, as_json, speed, lockstep)
    options.prepare()
    _fly_manoeuvres(rows, options, several=every or len(rows) > 1)


def _fly_manoeuvres(rows: Sequence["Manoeuvre"], options: FlightOptions, several: bool) -> None:
    """Fly manoeuvres, with --up each with a fleet of its own, and print and write their reports."""
    results = Results(options.report, several)
    try:
        for number, row in enumerate(rows, 1):
            progress = Progress(row.name if len(rows) == 1 else f"[{number}/{len(rows)}] {row.name}")
            with flown_fleet(options, options.fleet or row.fleet) as (running, interrupts):
                _fly_row(row, running, interrupts, progress, results)
    finally:
        results.write_page()
    results.print(options.as_json)
    if not results.passed:
        raise typer.Exit(EXIT_FAILED)


def _chosen(names: Sequence[str], every: bool) -> list["Manoeuvre"]:
    from rcopterx.ground_station.acceptance.manoeuvres import MANOEUVRES

    if every and names:
        raise typer.BadParameter("either names of manoeuvres or --all", param_hint="NAME")
    if every:
        return list(MANOEUVRES.values())
    if not names:
        raise typer.BadParameter("name a manoeuvre, or say --all", param_hint="NAME")
    check_known(names, MANOEUVRES, "manoeuvre", "NAME")
    return [MANOEUVRES[name] for name in names]


def _fly_row(
    row: "Manoeuvre", fleet: "Fleet", stop: Interrupts, progress: Progress, results: "Results"
) -> None:
    from rcopterx.ground_station.acceptance.flight import fly as fly_manoeuvre
    from rcopterx.ground_station.acceptance.flight import not_flown, reason_not_to_fly, report_of
    from rcopterx.ground_station.scripting.observer import STARTED_S
    from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS
    from rcopterx.ground_station.scripting.waiting import StoppedError, stopped_by

    if (reason := reason_not_to_fly(row, fleet)) is not None:
        progress.say(f"not flown: {reason}")
        results.add(not_flown(row, "not flown", reason))
        return

    def wait(seconds: float) -> None:
        end_s = clock() + seconds
        while (left_s := end_s - clock()) > 0:
            fleet.wait(min(left_s, SLICE_S))
            progress.show(f"about {row.seconds:.0f} s")

    clock = fleet.session.clock
    started_s = clock()
    try:
        with stopped_by(stop):
            fleet.wait_ready(timeout_s=STARTED_S)
        flown = fly_manoeuvre(row, fleet, progress.say, wait, stop)
    except StoppedError as error:
        results.add(not_flown(row, "failed", str(error)))
        raise
    except FLIGHT_ERRORS as error:
        progress.say(f"failed: {error}")
        results.add(not_flown(row, "failed", str(error)))
        return
    names = list(fleet.file.vehicles)
    report = report_of(row, flown, names, clock() - started_s)
    progress.say(report["verdict"])
    results.write(report, flown.recording, fleet.file)


class Results:
    """Reports of flights, and their files in a directory, if any; of several flights in subdirectories."""

    def __init__(self, directory: Path | None, several: bool) -> None:
        self._directory = directory
        self._several = several
        self._reports: list[dict[str, Any]] = []
        self._flights: dict[str, str] = {}  # pages that play them, by manoeuvre, relative to the directory

    @property
    def passed(self) -> bool:
        """Whether at least one flight passed and none failed."""
        verdicts = {report["verdict"] for report in self._reports}
        return "passed" in verdicts and "failed" not in verdicts

    def add(self, report: dict[str, Any]) -> None:
        """Add a report of what was not flown."""
        self._reports.append(report)

    def write(self, report: dict[str, Any], recording: "Recording", file: "FleetFile") -> None:
        """Add the report of a flight, and write it and the page that plays the flight."""
        self.add(report)
        if self._directory is None:
            return
        from rcopterx.flights.mcap_records import FlightLogError
        from rcopterx.flights.provenance import provenance
        from rcopterx.ground_station.acceptance.flight import write_report
        from rcopterx.ground_station.report.logged_flight import flight_of
        from rcopterx.ground_station.report.page import report_page

        name = report["manoeuvre"]
        where = self._directory / name if self._several else self._directory
        typer.echo(f"report: {write_report(report, where)}", err=True)
        started = time.strftime("%Y-%m-%dT%H:%M", time.localtime(time.time() - report["seconds"]))
        with suppress(FlightLogError):  # nothing was seen
            flight = flight_of(name, file, recording, {"started": started} | provenance())
            (where / FLIGHT_NAME).write_text(report_page(flight), encoding="utf-8")
            self._flights[name] = (where / FLIGHT_NAME).relative_to(self._directory).as_posix()

    def write_page(self) -> None:
        """Write the page about all flights."""
        from rcopterx.ground_station.acceptance.flight_page import write_page

        if self._directory is not None and self._reports:
            typer.echo(f"page: {write_page(self._reports, self._flights, self._directory)}", err=True)

    def print(self, as_json: bool) -> None:
        """Print the reports."""
        from rcopterx.ground_station.acceptance.flight import reason_of

        if not self._several:
            print_document(self._reports[0], as_json, _readable)
            return
        lines = (
            f"{one['verdict']:9} {one['manoeuvre']:24} {reason_of(one)}".rstrip() for one in self._reports
        )
        print_document(self._reports, as_json, lambda _: "\n".join(lines))


def _readable(report: dict[str, Any]) -> str:
    lines = [f"{report['manoeuvre']}: {report['verdict']} ({report['seconds']} s)"]
    if report["problem"] is not None:
        lines.append(f"  {report['problem']}")
    lines += [
        f"  {'ok    ' if check['passed'] else 'FAILED'} {check['name']}: {check['figure']}"
        for check in report["checks"]
    ]
    lines += [f"  {remark}" for remark in report["remarks"]]
    for figure in ("pose_to_command_ms", "frame_to_radio_ms"):
        lines.append(f"  {figure}: {report[figure]}")
    lines += [f"  {name}: {json.dumps(table)}" for name, table in report["vehicles"].items()]
    return "\n".join(lines)
