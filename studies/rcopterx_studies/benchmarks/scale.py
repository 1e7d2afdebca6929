"""Fleets of growing size on this computer, up to the first that misses control periods.

Every fleet is a leader with the others on rings around it, in the simulated laboratory, with all processes of
a real flight; the leader flies from set point to set point, so that all plans change.
"""

import math
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from itertools import cycle
from pathlib import Path
from typing import Any, Final

from rcopterx.bus import channels
from rcopterx.bus.session import RawMessage
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, lines_of
from rcopterx_studies.benchmarks.processes import Show, cpu_s, descendants, memory_of, wake_ups
from rcopterx_studies.figures import finish_figure

RATE_HZ: Final = 50.0  # frames of the motion capture; control periods stay 20 ms
SETTLE_S: Final = 3.0  # pause after the formation is reached, so that the take-off is not measured
LEG_S: Final = 4.0  # between two set points of the leader
LEGS_M: Final = ((0.2, 0.0, 1.0), (0.2, 0.2, 1.2), (0.0, 0.2, 1.0), (0.0, 0.0, 1.0))
RING_M: Final = 0.75  # radius of the first ring, and distance from ring to ring
FIRST_RING: Final = 9  # vehicles on the first ring; twice as many on the second, and so on
MARGIN_M: Final = 0.45
COUNTED_S: Final = 2.0  # for which messages are counted, after the flight: that takes time itself
LEFT_OUT: Final = "control_left_out"  # fallback of agents that control at half rate
ROLES: Final = ("router", "learner", "simulator", "tracker", "transmitters", "agent")
WAKE_UPS: Final = "wake_ups"


@dataclass(frozen=True)
class Series:
    """What the fleets of a series have in common."""

    horizon: int = 30
    seconds: float = 60.0  # time for which each flies from set point to set point, in the time of the fleet
    rate_hz: float = RATE_HZ
    speed: float = 1.0  # seconds of the fleet in a second of real time


def fleet_text(vehicles: int, horizon: int, rate_hz: float = RATE_HZ) -> str:
    """Fleet file with a number of vehicles, a horizon and a frame rate of the simulated Tracker."""
    room_m = RING_M * _ring(vehicles - 1)[0] + MARGIN_M
    text = (files(__package__) / "fleet.template").read_text("utf-8")
    head = text.format(low_m=-room_m, high_m=room_m, rate_hz=rate_hz, horizon=horizon)
    return head + "\n".join(_vehicle(number) for number in range(vehicles))


def _vehicle(number: int) -> str:
    follow = ""
    if number:
        ring, place = _ring(number)
        angle = 2 * math.pi * place / (FIRST_RING * ring)
        x, y = RING_M * ring * math.cos(angle), RING_M * ring * math.sin(angle)
        follow = f'follow = [{{ leader = "h1", offset_m = [{x:.3f}, {y:.3f}, 0.0] }}]'
    return f"""
[vehicles.h{number + 1}]
subject = "heli{number + 1}"
transmitter = {{ port = "radio-h{number + 1}", model_match = {(number + 1) % 64} }}
{follow}
"""


def _ring(number: int) -> tuple[int, int]:
    """Ring of a follower, and its place on it."""
    ring, place = 1, number - 1
    while place >= FIRST_RING * ring:
        place -= FIRST_RING * ring
        ring += 1
    return ring, place


def run(sizes: Sequence[int], series: Series, show: Show) -> dict[str, Any]:
    """Fly fleets of growing size; returns the JSON document of `rcopterx bench scale`.

    `largest_fleet` is the largest one up to which no fleet missed or left out a control period, 0 if the
    first one did. A fleet that cannot be flown has a `problem` in `runs`, and no larger one is flown.
    """
    runs: list[dict[str, Any]] = []
    for vehicles in sorted(sizes):
        try:
            runs.append(_measured(vehicles, series, show))
        except FLIGHT_ERRORS as error:
            show(f"{vehicles} vehicles: {'; '.join(lines_of(error))}")
            failed = {"missed_ticks": None, "pose_to_command_ms": None, "problem": str(error)}
            runs.append({"vehicles": vehicles, "horizon": series.horizon, **failed})
            break
    largest = 0
    for row in runs:
        if row["missed_ticks"] != 0 or row["left_out_ticks"] != 0:
            break
        largest = row["vehicles"]
    common = {"seconds": series.seconds, "rate_hz": series.rate_hz, "speed": series.speed}
    return {"largest_fleet": largest, **common, "runs": runs}


@contextmanager
def in_formation(vehicles: int, series: Series) -> Iterator[tuple[Fleet, Launcher]]:
    """A fleet in formation, and its launcher; at the end it lands and is stopped."""
    with tempfile.TemporaryDirectory(prefix="rcopterx-") as directory:
        path = Path(directory) / "scale.toml"
        path.write_text(fleet_text(vehicles, series.horizon, series.rate_hz), encoding="utf-8")
        with launched(path, record=False, speed=series.speed) as fleet:
            assert fleet.launcher is not None
            fleet.take_off()
            fleet.wait_for_formation()
            fleet.wait(SETTLE_S)
            yield fleet, fleet.launcher


def fly_legs(fleet: Fleet, seconds: float, flown: Callable[[float], object] = lambda _: None) -> None:
    """Send the leader from set point to set point; calls `flown` before each with the time flown [s]."""
    clock = fleet.session.clock
    until_s = clock() + seconds
    for leg_m in cycle(LEGS_M):
        left_s = until_s - clock()
        if left_s <= 0:
            return
        flown(seconds - left_s)
        fleet["h1"].go_to(leg_m)
        fleet.wait(min(LEG_S, left_s))


def _measured(vehicles: int, series: Series, show: Show) -> dict[str, Any]:
    show(f"{vehicles} vehicles: starting")
    with in_formation(vehicles, series) as (fleet, launcher):
        recorder = FlightSampler(fleet.session, only=(channels.POSE, channels.APPLIED, channels.AGENT_STATUS))
        clock, before = fleet.session.clock, _used(launcher)
        began_s = clock()
        recorder.start()
        fly_legs(
            fleet,
            series.seconds,
            lambda flown_s: show(f"{vehicles} vehicles: {flown_s:.0f} of {series.seconds:g} s flown"),
        )
        recording = recorder.stop()
        flown_s = clock() - began_s
        rates = {what: (after - before[what]) / flown_s for what, after in _used(launcher).items()}
        counted = _traffic(fleet)
        memory_mb = memory_of(descendants(os.getpid()))
        names = list(fleet.file.vehicles)
    figures = FlightFigures(recording, names)
    tables = [figures.vehicle(name) for name in names]
    shares = {role: round(rates[role], 3) for role in ROLES}
    row = {
        "vehicles": vehicles,
        "horizon": series.horizon,
        "ticks": sum(table["ticks"] for table in tables),
        "missed_ticks": sum(table["missed_ticks"] for table in tables),
        "left_out_ticks": sum(table["fallbacks"].get(LEFT_OUT, 0) for table in tables),
        "fallbacks": dict(sum((Counter(table["fallbacks"]) for table in tables), Counter())),
        "pose_to_command_ms": percentiles(figures.pose_to_command_ms()),
        "solve_ms_p99": max(table["solve_ms"]["p99"] for table in tables),
        "cpu_share": shares,
        "per_vehicle": {
            "cores": round(sum(shares.values()) / vehicles, 4),
            "wake_ups_hz": round(rates[WAKE_UPS] / vehicles, 1),
            "messages_hz": round(counted["messages"] / vehicles, 1),
            "kilobytes_hz": round(counted["bytes"] / vehicles / 1000, 2),
            "memory_mb": round(memory_mb / vehicles, 1),
        },
    }
    show(
        f"{vehicles} vehicles: {row['missed_ticks']} missed, {row['left_out_ticks']} left out, "
        f"pose to command {row['pose_to_command_ms']}"
    )
    return row


def _used(launcher: Launcher) -> dict[str, float]:
    """Processor time that the processes of each role have used so far [s], and wake-ups of the agents."""
    used = dict.fromkeys((*ROLES, WAKE_UPS), 0.0)
    for name, child in launcher.supervisor.children.items():
        pid = launcher.supervisor.pid(name)
        if pid is not None:
            used[child.spec.role] += cpu_s(pid)
            if child.spec.role == "agent":
                used[WAKE_UPS] += wake_ups(pid)
    return used


def _traffic(fleet: Fleet) -> dict[str, float]:
    """Messages and bytes of all processes that a router gets in a second, each once."""
    total: Counter[str] = Counter()

    def count(message: RawMessage) -> None:
        total.update(messages=1, bytes=len(message.payload))

    began_s = fleet.session.clock()
    fleet.session.tap(count)
    fleet.wait(COUNTED_S)
    seen, seconds = dict(total), fleet.session.clock() - began_s
    return {what: seen.get(what, 0) / seconds for what in ("messages", "bytes")}


def scale_table(document: dict[str, Any]) -> str:
    """Table of the runs, as text."""
    lines = [
        f"{'vehicles':>8}{'missed':>8}{'left out':>10}{'p50':>9}{'p99':>9}{'max':>9}{'cores':>8}"
        "  [ms]; per vehicle: cores, wake-ups, messages and kB in a second, MB"
    ]
    for row in document["runs"]:
        if "problem" in row:
            lines.append(f"{row['vehicles']:>8}  {row['problem']}")
            continue
        times = "".join(f"{row['pose_to_command_ms'][name]:>9.2f}" for name in ("p50", "p99", "max"))
        load = sum(row["cpu_share"].values())
        counts = f"{row['missed_ticks']:>8}{row['left_out_ticks']:>10}"
        each = "".join(f"{value:>9g}" for value in row["per_vehicle"].values())
        lines.append(f"{row['vehicles']:>8}{counts}{times}{load:>8.2f}{each}")
    lines.append(f"largest fleet without a missed or left out control period: {document['largest_fleet']}")
    return "\n".join(lines)


def draw_scale(document: dict[str, Any], figure: Any) -> None:
    """Draw pose to command and the load against the number of vehicles."""
    figure.set_size_inches(10, 4.2)
    left, right = figure.subplots(1, 2)
    rows = [row for row in document["runs"] if row["pose_to_command_ms"]]
    sizes = [row["vehicles"] for row in rows]
    for name, style in (("p50", "o-"), ("p99", "s-"), ("max", "^:")):
        left.plot(sizes, [row["pose_to_command_ms"][name] for row in rows], style, label=name)
    for row in rows:
        if row["missed_ticks"]:
            place = (row["vehicles"], row["pose_to_command_ms"]["p50"])
            left.annotate(f"{row['missed_ticks']} missed", place, fontsize="small", rotation=60)
    horizon, rate_hz = document["runs"][0]["horizon"], document["rate_hz"]
    title = f"N = {horizon}, Tracker {rate_hz:g} Hz, {document['seconds']:g} s each"
    left.set(title=title, ylabel="pose to command [ms]")
    bottom = [0.0] * len(rows)
    for role in ROLES:
        values = [row["cpu_share"][role] for row in rows]
        right.bar(sizes, values, bottom=bottom, label=role, width=0.8)
        bottom = [base + value for base, value in zip(bottom, values, strict=True)]
    right.set(title="load by role", ylabel="processor cores used")
    for axes in (left, right):
        axes.set(xlabel="vehicles", ylim=(0.0, None))
        axes.legend(fontsize="small")
    finish_figure(figure)
