"""Time from SIGKILL of a process of a hovering formation until the vehicles are flown again, on one host."""

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rcopterx.bus import channels
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.deploy.hosts.run_directory import states_directory
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler, Recording
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx.transmitter_gateway.state_page import BOOT_ID, StatePage
from rcopterx_studies.benchmarks.processes import Show

SETTLE_S = 3.0
WATCH_S = 4.0
SPARE_LIMIT_S = 30.0
POLL_S = 0.002
HEIGHT_M = 1.0


def victims_of(fleet: Fleet) -> dict[str, list[str]]:
    """Vehicles by the process they need: agents of a leader and of a follower, router, gateways."""
    vehicles = fleet.file.vehicles
    leaders = [name for name, vehicle in vehicles.items() if not vehicle.follow]
    followers = [name for name, vehicle in vehicles.items() if vehicle.follow]
    victims = {f"agent-{name}": [name] for name in (*leaders[:1], *followers[:1])}
    victims |= {"router": list(vehicles), "tracker": list(vehicles)}
    for name, vehicle in vehicles.items():
        victims.setdefault(vehicle.transmitter.gateway, []).append(name)
    return victims


def run(path: Path, rounds: int, show: Show) -> dict[str, Any]:
    """Measure; returns the JSON document of `rcopterx bench restart`.

    Raises `NotReachedError`: a vehicle did not come back.
    """
    kills: dict[str, list[dict[str, Any]]] = {}
    with launched(path) as fleet:
        assert fleet.launcher is not None
        fleet.take_off(height_m=HEIGHT_M)
        fleet.wait_for_formation()
        for number in range(rounds):
            for process, vehicles in victims_of(fleet).items():
                show(f"round {number + 1} of {rounds}: {process}")
                row = _killed(fleet, fleet.launcher, process, vehicles)
                kills.setdefault(process, []).append(row)
    return {
        "fleet": fleet.file.name,
        "rounds": rounds,
        "kills": {process: summary(rows) for process, rows in kills.items()},
    }


def _killed(fleet: Fleet, launcher: Launcher, process: str, vehicles: Sequence[str]) -> dict[str, Any]:
    supervisor = launcher.supervisor
    fleet.wait_until(lambda: supervisor.spares.ready() > 0, SPARE_LIMIT_S, "no spare process")
    recorder = FlightSampler(fleet.session)
    recorder.start()
    fleet.wait(SETTLE_S)
    pid = supervisor.pid(process)
    if pid is None:
        raise NotReachedError(f"{process} does not run")
    killed_s = fleet.session.clock()
    os.kill(pid, signal.SIGKILL)
    silent_ms = without_frames_ms(states_directory(launcher.directory), vehicles, killed_s)
    fleet.wait(WATCH_S)
    fleet.wait_until(
        lambda: all(fleet.state_of(name).phase == "flying" for name in fleet.file.vehicles),
        WATCH_S,
        f"not flying after {process} was killed",
        fleet.file.vehicles,
    )
    recording = recorder.stop()
    others = [name for name in fleet.file.vehicles if name not in vehicles]
    figures = FlightFigures(recording, list(fleet.file.vehicles))
    tables = {name: figures.vehicle(name) for name in fleet.file.vehicles}
    return {
        "without_frames_ms": silent_ms,
        "flown_again_ms": max(flown_again_ms(recording, name, killed_s) for name in vehicles),
        "deviation_mm": deviation_mm(recording, vehicles, killed_s),
        "deviation_before_mm": deviation_mm(recording, vehicles, killed_s, before=True),
        "others_deviation_mm": deviation_mm(recording, others, killed_s),
        "others_deviation_before_mm": deviation_mm(recording, others, killed_s, before=True),
        "events": {
            name: {what: table[what] for what in ("radio_frames", "fallbacks")}
            for name, table in tables.items()
        },
    }


def without_frames_ms(states: Path, names: Sequence[str], killed_s: float) -> float:
    """From the kill until a serial frame has been written to every vehicle, from their state pages."""
    boot, written_s = BOOT_ID.read_bytes(), dict.fromkeys(names, killed_s)
    limit_s = time.monotonic() + WATCH_S
    while min(written_s.values()) <= killed_s:
        if time.monotonic() > limit_s:
            raise NotReachedError("no serial frames are written any more")
        for name in names:
            last = StatePage(bytearray((states / name).read_bytes()), boot).last
            if written_s[name] <= killed_s and last is not None:
                written_s[name] = last.written_s
        time.sleep(POLL_S)
    return round(1000 * (max(written_s.values()) - killed_s), 1)


def flown_again_ms(recording: Recording, name: str, killed_s: float) -> float:
    """From the kill to the first radio frame whose command was computed from a pose after it."""
    poses = recording.messages(channels.POSE, name)
    after = {(pose.epoch, pose.frame) for pose, arrived_s in poses if arrived_s > killed_s}
    for applied, arrived_s in recording.messages(channels.APPLIED, name):
        if applied.fresh and applied.state == "armed" and (applied.epoch, applied.frame) in after:
            return round(1000 * (arrived_s - killed_s), 1)
    raise NotReachedError(f"{name} is not flown any more")


def deviation_mm(
    recording: Recording, names: Sequence[str], killed_s: float, *, before: bool = False
) -> float | None:
    """Largest distance of the vehicles from the middle of their true places before the kill [mm]."""
    states = recording.messages(channels.LABORATORY, channels.SIMULATOR_UNIT)
    distances_m = []
    for name in names:
        early = [m.vehicles[name].position_m for m, at_s in states if at_s <= killed_s]
        late = [m.vehicles[name].position_m for m, at_s in states if at_s > killed_s]
        places = np.array(early if before else late) - np.mean(early, axis=0)
        distances_m.append(float(np.linalg.norm(places, axis=1).max()))
    return round(1000 * max(distances_m), 1) if distances_m else None


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Percentiles of the figures of several kills, and their events."""
    figures: dict[str, Any] = {}
    for field in rows[0]:
        values = [row[field] for row in rows if isinstance(row[field], float)]
        if values:
            figures[field] = percentiles(values)
    return figures | {"events": [row["events"] for row in rows]}
