"""A fleet of more vehicles than this computer serves: do all fly on, at a lower rate, and keep apart?

The fleets are those of `rcopterx bench scale`. The launcher measures how many vehicles the computer serves,
which depends on the fleet and varies with time, so fleets start until one is too large by the given factor.
"""

import math
import os
import time
from collections import Counter
from itertools import combinations
from typing import Any, Final

from rcopterx.benchmarks.programs import Show
from rcopterx.benchmarks.scale import LEFT_OUT, cpu_of_roles, fly_legs, in_formation, started
from rcopterx.bus import channels
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Recorder
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import NotReachedError

FIRST: Final = 6
"""Vehicles for each processor in the first fleet."""
LARGEST: Final = 63
ATTEMPTS: Final = 10
MEASURED_S: Final = 60.0
"""Limit for a launcher to measure how many vehicles its computer serves."""
ARMED: Final = "armed"


def run(factor: float, horizon: int, seconds: float, show: Show) -> dict[str, Any]:
    """Fly a fleet that is too large by a factor; returns the JSON document of `rcopterx bench overload`.

    Returns
    -------
    dict
        `serves` and `vehicles`; `missed_ticks` and `left_out_ticks` of all; `not_armed`, for each vehicle
        that its agent did not fly all the time, radio frames by state; `touchdowns`; `closest_m`, the
        smallest distance between two vehicles; `off_mm_rms`, by how much vehicles are off their references;
        and `cores`, the processor time of all processes.
    """
    vehicles, serves = _too_many(factor, horizon, show)
    with in_formation(vehicles, horizon) as (fleet, launcher):
        show(f"{vehicles} vehicles fly")
        return {"serves": serves, "vehicles": vehicles, "seconds": seconds} | _watched(
            fleet, launcher, seconds, show
        )


def _too_many(factor: float, horizon: int, show: Show) -> tuple[int, int]:
    """Size of a fleet that is too large by the factor, and how many vehicles this computer serves of it."""
    vehicles = FIRST * len(os.sched_getaffinity(0))
    for _ in range(ATTEMPTS):
        serves = _served(vehicles, horizon)
        show(f"of a fleet of {vehicles} this computer serves {serves}")
        # The measurement varies by a vehicle from start to start.
        if factor * serves <= vehicles < factor * (serves + 2):
            return vehicles, serves
        vehicles = math.ceil(factor * serves)
        if vehicles > LARGEST:
            raise NotReachedError(f"{factor:g} times what this computer serves are more than {LARGEST}")
    raise NotReachedError(f"how many vehicles this computer serves was different {ATTEMPTS} times")


def _served(vehicles: int, horizon: int) -> int:
    with started(vehicles, horizon) as (fleet, _):
        fleet.wait_until(
            lambda: all(status.flies is not None for status in fleet.launchers().values()),
            MEASURED_S,
            "it is not known how many vehicles this computer serves",
        )
        return sum(max(1, status.flies or 0) for status in fleet.launchers().values())


def _watched(fleet: Fleet, launcher: Launcher, seconds: float, show: Show) -> dict[str, Any]:
    only = (channels.POSE, channels.APPLIED, channels.AGENT_STATUS, channels.LABORATORY)
    recorder, names = Recorder(fleet.session, only=only), list(fleet.file.vehicles)
    used_s, began_s = sum(cpu_of_roles(launcher).values()), time.monotonic()
    recorder.start()
    fly_legs(fleet, seconds, lambda flown_s: show(f"{flown_s:.0f} of {seconds:g} s flown"))
    recording = recorder.stop()
    cores = (sum(cpu_of_roles(launcher).values()) - used_s) / (time.monotonic() - began_s)
    return verdict(FlightFigures(recording, names), names) | {"cores": round(cores, 2)}


def verdict(figures: FlightFigures, names: list[str]) -> dict[str, Any]:
    """Figures of the recorded part of a flight."""
    tables = [figures.vehicle(name) for name in names]
    states = {name: Counter(applied.state for applied in figures.applied(name)) for name in names}
    truths = [figures.truth(name) for name in names]
    off_m = [
        status.error_m for name in names for status in figures.statuses(name) if status.error_m is not None
    ]
    return {
        "missed_ticks": sum(table["missed_ticks"] for table in tables),
        "left_out_ticks": sum(table["fallbacks"].get(LEFT_OUT, 0) for table in tables),
        "not_armed": {
            name: {state: count for state, count in counts.items() if state != ARMED}
            for name, counts in states.items()
            if set(counts) != {ARMED}
        },
        "touchdowns": sum(truth[-1].touchdowns - truth[0].touchdowns for truth in truths if truth),
        "off_mm_rms": round(1e3 * math.sqrt(sum(off * off for off in off_m) / max(1, len(off_m))), 1),
        "closest_m": round(
            min(float(figures.distances_m(*pair).min(initial=math.inf)) for pair in combinations(names, 2)), 3
        ),
    }
