"""Measuring speed, side by side with peers: `bench`."""

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from rcopterx.commands.experiment import check_plot
from rcopterx.commands.fleet_option import DEFAULT_FLEET, EXIT_FAILED, FleetOption, failure, user_errors
from rcopterx.commands.numbers import different_numbers

app = typer.Typer(no_args_is_help=True)

JsonOption = Annotated[bool, typer.Option("--json", help="Print the JSON document.")]
PlotOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Draw the figure into this file (png, svg, pdf).")
]

COLUMNS = ("mean_ms", "p99_ms", "p999_ms", "max_ms", "error")


@app.callback()
def bench() -> None:
    """Measure speed, side by side with peers."""


def _progress(name: str) -> Callable[[str], None]:
    return lambda text: typer.echo(f"bench {name}: {text}", err=True)


def _print(document: dict[str, Any], as_json: bool, readable: Callable[[dict[str, Any]], str]) -> None:
    typer.echo(json.dumps(document, indent=2) if as_json else readable(document))


@app.command()
def solver(
    as_json: JsonOption = False,
    horizons: Annotated[
        str, typer.Option(metavar="N,N,...", help="Horizons, in stages.")
    ] = "10,18,30,50,80,110",
    steps: Annotated[
        int | None, typer.Option(metavar="N", min=2, help="Control steps to measure per horizon.")
    ] = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Seed of the flight the steps come from.")
    ] = 0,
    plot: PlotOption = None,
) -> None:
    """Time control steps of the cascade, the paper's scheme and other solvers on the same problems."""
    from rcopterx.benchmarks.solver import STEPS, run
    from rcopterx.benchmarks.solver_figure import draw_solver
    from rcopterx.experiments.figures import save_figure

    check_plot(plot)
    document = run(
        different_numbers(horizons, "--horizons", lowest=2, highest=200),
        STEPS if steps is None else steps,
        seed,
        _progress("solver"),
    )
    if plot is not None:
        save_figure(partial(draw_solver, document), plot)
        typer.echo(f"figure: {plot}", err=True)
    _print(document, as_json, _solver_lines)


@app.command()
def restart(
    as_json: JsonOption = False,
    rounds: Annotated[int, typer.Option(metavar="N", min=1, help="Kills of each process.")] = 5,
    fleet: FleetOption = DEFAULT_FLEET,
) -> None:
    """Kill agents, router and Vicon gateway in flight, and time how soon the vehicles are flown again."""
    from rcopterx.benchmarks.restart import run
    from rcopterx.fleet.shipped import fleet_path

    with user_errors():
        document = run(fleet_path(fleet), rounds, _progress("restart"))
    _print(document, as_json, _restart_lines)


def _restart_lines(document: dict[str, Any]) -> str:
    """The start-up of a cold agent, then one line per process and figure."""
    start_up = ", ".join(
        f"{name.removesuffix('_ms')} {ms:g} ms" for name, ms in document["start_up_ms"].items()
    )
    lines = [f"cold start: {start_up}", f"{'killed':12}{'figure':28}{'p50':>10}{'max':>10}"]
    for process, figures in document["kills"].items():
        lines += [
            f"{process:12}{name:28}{row['p50']:>10.1f}{row['max']:>10.1f}"
            for name, row in figures.items()
            if name != "events"
        ]
    return "\n".join(lines)


@app.command()
def gateway(
    as_json: JsonOption = False,
    transmitters: Annotated[int, typer.Option(metavar="N", min=1, max=32, help="Transmitters served.")] = 8,
    seconds: Annotated[float, typer.Option(metavar="S", min=1, max=600, help="Duration.")] = 20.0,
) -> None:
    """Measure the load of a transmitter gateway, and the time from a command to its serial frame."""
    from rcopterx.benchmarks.gateway import run

    document = run(transmitters, seconds, _progress("gateway"))
    _print(document, as_json, _gateway_line)


def _gateway_line(document: dict[str, Any]) -> str:
    times = ", ".join(f"{name} {value:.3f}" for name, value in document["write_ms"].items())
    return (
        f"{document['transmitters']} transmitters: {document['cpu_share']:.1%} of one core; "
        f"write on arrival [ms]: {times}; {document['writes']} writes; "
        f"load of the machine before {document['load_before']:.1f}"
    )


@app.command()
def requests(
    as_json: JsonOption = False,
    rounds: Annotated[int, typer.Option(metavar="N", min=1, help="Requests of each kind.")] = 100,
) -> None:
    """Time requests to agents in flight, on the trio."""
    from rcopterx.benchmarks.request_times import run
    from rcopterx.fleet.shipped import fleet_path

    with user_errors():
        path = fleet_path("trio")
        document = run(path, rounds, _progress("requests"))
    _print(document, as_json, _request_lines)


def _request_lines(document: dict[str, Any]) -> str:
    return "\n".join(
        f"{name:22}" + "".join(f"{key:>6} {value:8.3f}" for key, value in row.items()) + "  [ms]"
        for name, row in document["round_trip_ms"].items()
    )


@app.command()
def scale(
    as_json: JsonOption = False,
    vehicles: Annotated[
        str, typer.Option(metavar="N,N,...", help="Numbers of vehicles to fly.")
    ] = "3,6,8,10,12,14,16",
    horizon: Annotated[int, typer.Option(metavar="N", min=2, max=200, help="Stages N.")] = 30,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=1, max=3600, help="Duration of the flight of each fleet.")
    ] = 60.0,
    rate: Annotated[
        float,
        typer.Option(
            metavar="HZ", min=50, max=400, help="Frame rate of the simulated Tracker; control stays 50 Hz."
        ),
    ] = 50.0,
    plot: PlotOption = None,
) -> None:
    """Fly fleets of growing size on this computer: missed control periods, pose to command, load."""
    from rcopterx.benchmarks.scale import draw_scale, run, scale_table
    from rcopterx.experiments.figures import save_figure

    check_plot(plot)
    sizes = different_numbers(vehicles, "--vehicles", lowest=1, highest=63)
    with user_errors():
        document = run(sizes, horizon, seconds, _progress("scale"), rate)
    if plot is not None:
        save_figure(partial(draw_scale, document), plot)
    _print(document, as_json, scale_table)


@app.command()
def overload(
    as_json: JsonOption = False,
    factor: Annotated[
        float,
        typer.Option(metavar="F", min=0.5, max=5, help="Vehicles for each one that this computer serves."),
    ] = 1.5,
    horizon: Annotated[int, typer.Option(metavar="N", min=2, max=200, help="Stages N.")] = 30,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=1, max=3600, help="Duration of the flight.")
    ] = 60.0,
) -> None:
    """Fly a fleet too large for this computer: control rate, distances, touchdowns."""
    from rcopterx.benchmarks.overload import run

    with user_errors():
        document = run(factor, horizon, seconds, _progress("overload"))
    _print(document, as_json, _overload_lines)


def _overload_lines(document: dict[str, Any]) -> str:
    lines = [
        f"{document['vehicles']} vehicles where {document['serves']} are served, {document['seconds']:g} s, "
        f"{document['cores']} cores used",
        f"control periods left out: {document['left_out_ticks']}, missed: {document['missed_ticks']}",
        f"smallest distance: {document['closest_m']} m; touchdowns: {document['touchdowns']}; "
        f"{document['off_mm_rms']} mm rms off their references",
    ]
    for name, states in document["not_armed"].items():
        counts = ", ".join(f"{state} in {count} radio frames" for state, count in states.items())
        lines.append(f"{name} was not flown by its agent all the time: {counts}")
    if not document["not_armed"]:
        lines.append("all vehicles were flown by their agents all the time")
    return "\n".join(lines)


@app.command()
def cost(
    against: Annotated[Path, typer.Option(metavar="DIRECTORY", help="Checkout to compare this one with.")],
    as_json: JsonOption = False,
    only: Annotated[
        str,
        typer.Option(
            metavar="NAME,NAME,...",
            help="Trials to run: six vehicles, trio, radio, step, largest. Default: all but largest.",
        ),
    ] = "six,trio,radio,step",
    rounds: Annotated[int, typer.Option(metavar="N", min=1, help="Runs of each trial and checkout.")] = 3,
) -> None:
    """Compare this checkout with another one in alternating runs: load, latency, memory."""
    from rcopterx.benchmarks.cost import TRIALS, CostError, run, table

    names = only.split(",")
    if unknown := [name for name in names if name not in TRIALS]:
        raise typer.BadParameter(f"{unknown[0]}: there are {', '.join(TRIALS)}", param_hint="--only")
    try:
        document = run(against, names, rounds, _progress("cost"))
    except CostError as error:
        raise failure(error) from None
    _print(document, as_json, lambda found: "\n".join(table(found)))


@app.command()
def links(
    as_json: JsonOption = False,
    rounds: Annotated[int, typer.Option(metavar="N", min=1, help="Cuts of each length.")] = 5,
    cuts: Annotated[
        str, typer.Option("--cuts-ms", metavar="MS,MS,...", help="Lengths of the cuts, in milliseconds.")
    ] = "100,300,1000,3000",
) -> None:
    """Cut the link of two hosts, and time how soon both directions carry data again. Needs root."""
    from rcopterx.benchmarks.links import run

    cuts_s = [cut_ms / 1e3 for cut_ms in different_numbers(cuts, "--cuts-ms", lowest=1, highest=60_000)]
    with _network_errors():
        document = run(cuts_s, rounds, _progress("links"))
    _print(document, as_json, _link_lines)


def _link_lines(document: dict[str, Any]) -> str:
    lines = [f"{'cut [s]':>8}  {'direction':10}{'heal [ms]':>24}{'longest gap [ms]':>18}{'stale':>7}"]
    for cut, done in document["cuts"].items():
        for direction in done[0]:
            rows = [each[direction] for each in done]
            heals = sorted(math.inf if row["heal_ms"] is None else row["heal_ms"] for row in rows)
            lines.append(
                f"{cut:>8}  {direction:10}{f'{heals[len(heals) // 2]:.0f}, at most {heals[-1]:.0f}':>24}"
                f"{max(row['gap_ms'] for row in rows):>18.0f}{max(row['stale'] for row in rows):>7}"
            )
    return "\n".join(lines)


@app.command()
def hosts(
    as_json: JsonOption = False,
    rounds: Annotated[int, typer.Option(metavar="N", min=1, help="Flights of each kind.")] = 2,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=1, max=600, help="Duration of each flight.")
    ] = 20.0,
) -> None:
    """Time pose to command over four hosts with mutual TLS, against one host without. Needs root."""
    from rcopterx.benchmarks.hosts import run

    with user_errors(), _network_errors():
        document = run(rounds, seconds, _progress("hosts"))
    _print(document, as_json, _host_lines)


def _host_lines(document: dict[str, Any]) -> str:
    lines = []
    for name in ("one_host", "four_hosts"):
        row = document[name]
        times = ", ".join(f"{kind} {value:.2f}" for kind, value in row["pose_to_command_ms"].items())
        lines.append(
            f"{name.replace('_', ' '):10} pose to command [ms]: {times}; "
            f"{row['missed']} of {row['periods']} periods missed"
        )
        for stage, figures in row["stages_ms"].items():
            lines.append(
                f"  {stage:28}" + ", ".join(f"{kind} {value:.2f}" for kind, value in figures.items())
            )
    return "\n".join([*lines, f"p99 over four hosts: {document['ratio_p99']:.2f} times that of one"])


@app.command()
def kill(
    as_json: JsonOption = False,
    repeats: Annotated[
        int, typer.Option("--presses", metavar="N", min=1, help="Kills by each of the two ways.")
    ] = 20,
    fleet: FleetOption = DEFAULT_FLEET,
) -> None:
    """Time KILL, by a script and by the space bar of the page, until every radio gets throttle low."""
    from rcopterx.benchmarks.kill_times import run
    from rcopterx.fleet.shipped import fleet_path

    with user_errors():
        document = run(fleet_path(fleet), repeats, _progress("kill"))
    _print(document, as_json, _kill_lines)


def _kill_lines(document: dict[str, Any]) -> str:
    lines = []
    for way, figures in document["low_ms"].items():
        text = "-" if figures is None else "p50 {p50:.0f}, p99 {p99:.0f}, max {max:.0f} ms".format(**figures)
        lines.append(f"{way:8}{text}")
    return "\n".join(lines)


@app.command()
def page(
    as_json: JsonOption = False,
    runs: Annotated[int, typer.Option(metavar="N", min=1, help="Starts of the page.")] = 5,
    from_start: Annotated[
        bool, typer.Option("--from-start", help="Start the fleet together with the page, each time.")
    ] = False,
    fleet: FleetOption = DEFAULT_FLEET,
) -> None:
    """Time the start of the web page of a fleet until it can be used in a browser."""
    from rcopterx.benchmarks.browser import NEEDED, browser_there
    from rcopterx.benchmarks.page_times import run
    from rcopterx.fleet.shipped import fleet_path

    if not browser_there():
        raise failure(f"this needs {NEEDED}")
    with user_errors():
        document = run(fleet_path(fleet), runs, from_start, _progress("page"))
    _print(document, as_json, _page_lines)


def _page_lines(document: dict[str, Any]) -> str:
    return "\n".join(
        "{:10}p50 {p50:.1f}, max {max:.1f} s".format(what.removesuffix("_s"), **document[what])
        for what in ("served_s", "usable_s")
    )


@app.command()
def alarms(
    as_json: JsonOption = False,
    seconds: Annotated[float, typer.Option(metavar="SECONDS", min=1, help="Length of the flight.")] = 3600.0,
    busy: Annotated[int, typer.Option(metavar="N", min=0, help="Busy processes beside it.")] = 2,
    fleet: FleetOption = DEFAULT_FLEET,
) -> None:
    """Hover beside busy processes. Exit code 1 if the watchdog ends a process that does not hang."""
    from rcopterx.benchmarks.false_alarms import run
    from rcopterx.fleet.shipped import fleet_path

    with user_errors():
        document = run(fleet_path(fleet), seconds, busy, _progress("alarms"))
    _print(
        document, as_json, lambda found: "\n".join(f"{name:18} {figure}" for name, figure in found.items())
    )
    if document["hung"] or document["spares_hung"]:
        raise typer.Exit(EXIT_FAILED)


@contextmanager
def _network_errors() -> Iterator[None]:
    """Report that network namespaces cannot be made, without a traceback."""
    from rcopterx.benchmarks.namespaces import NetworkUnavailableError

    try:
        yield
    except NetworkUnavailableError as error:
        raise failure(error) from None


def _solver_lines(document: dict[str, Any]) -> str:
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
