"""Flying a task with all processes of a fleet, in lockstep, with bus and protocols of the hardware."""

import os
from collections import Counter
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import msgspec
import numpy as np
import tomlkit

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.ground_station.report.recorder import FlightSampler, Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.simulator.conditions import Conditions
from rcopterx.vehicles.state import Array, turned_about_z
from rcopterx_studies.arena.flying import ROOM_M, FlownTask, MessageTraffic, figures_of
from rcopterx_studies.arena.tasks import ArenaTask
from rcopterx_studies.experiments.events import FlyEvent, FollowEvent, GoToEvent, LeadEvent, PilotEvent
from rcopterx_studies.experiments.knowledge import COAXIAL
from rcopterx_studies.experiments.record import FlightRecord, VehicleRecord, station_of
from rcopterx_studies.experiments.rig import PERIOD_S, Progress
from rcopterx_studies.experiments.schemes import FlownScheme
from support.bus import free_port

RECORDED: Final = (channels.LABORATORY, channels.PLAN, channels.SCHEME, channels.AGENT_STATUS)
STEADY_S: Final = 3.0  # from the formation at the start to the beginning of the task


def fly_with_processes(
    scheme: FlownScheme, task: ArenaTask, conditions: Conditions, seed: int, progress: Progress | None = None
) -> FlownTask:
    """Fly a task once; errors are those of `launched` and of requests."""
    with ExitStack() as stack:
        directory = Path(stack.enter_context(TemporaryDirectory(prefix="rcopterx-arena-")))
        path = directory / "arena.toml"
        path.write_text(tomlkit.dumps(fleet_table(scheme, task, conditions, seed)), encoding="utf-8")
        fleet = stack.enter_context(launched(path, record=False, lockstep=True))
        _fly_to_start(fleet, task)
        recorder = FlightSampler(fleet.session, only=RECORDED)
        recorder.start()
        began_s = fleet.session.clock()
        for event in sorted(task.events, key=lambda event: event.time_s):
            fleet.wait(began_s + event.time_s - fleet.session.clock())
            _apply(fleet, event)
            if progress is not None:
                progress(event.time_s / task.duration_s)
        fleet.wait(began_s + task.duration_s - fleet.session.clock())
        recording = recorder.stop()
    record = flight_record(recording, list(task.starts_m))
    bounds_m_s = dict.fromkeys(task.starts_m, np.array(COAXIAL.state_max[3:6]))
    return figures_of(record, task.errors_from_s, bounds_m_s, _traffic(recording), np.zeros(1))


def fleet_table(scheme: FlownScheme, task: ArenaTask, conditions: Conditions, seed: int) -> dict[str, Any]:
    """Fleet file for a task, on a free port and in a namespace of its own."""
    port = free_port()
    rough = task.turbulence * np.array(conditions.turbulence_rms)
    own = asdict(replace(conditions, turbulence_rms=tuple(rough.tolist())))
    real = ("transport_delay_s", "radio_period_s", "volume_min_m", "volume_max_m")
    vehicles = {
        name: {
            "subject": name,
            "transmitter": {"port": f"radio-{name}", "model_match": number},
            "follow": [msgspec.to_builtins(link) for link in task.links.get(name, ())],
        }
        for number, name in enumerate(task.starts_m)
    }
    return {
        "name": "arena",
        "bus": {"namespace": f"arena{os.getpid()}"},
        "volume": {"min_m": [-ROOM_M, -ROOM_M, 0.0], "max_m": [ROOM_M, ROOM_M, ROOM_M]},
        "tracker": {"address": f"127.0.0.1:{port}"},
        "simulator": {
            "seed": seed,
            "condition_overrides": {name: value for name, value in own.items() if name not in real},
            "start": {name: [x, y, 0.0, 0.0] for name, (x, y, _) in task.starts_m.items()},
        },
        "avoidance": {"enabled": task.options.avoid},
        "defaults": {
            "control": {
                "controller": scheme.controller,
                "settings": dict(scheme.settings),
                "horizon": scheme.horizon,
            }
        },
        "vehicles": vehicles,
    }


def _fly_to_start(fleet: Fleet, task: ArenaTask) -> None:
    """Take off, and bring all vehicles to rest where the task begins."""
    fleet.take_off(height_m=max(z for _, _, z in task.starts_m.values()))
    for name, place_m in task.starts_m.items():
        if name not in task.links:
            fleet[name].go_to(place_m)
    fleet.wait_for_arrival([name for name in task.starts_m if name not in task.links])
    if task.links:
        fleet.wait_for_formation()
    fleet.wait(STEADY_S)


def _apply(fleet: Fleet, event: PilotEvent) -> None:
    vehicle = fleet[event.vehicle]
    match event:
        case GoToEvent():
            vehicle.go_to(event.position_m, event.yaw_rad)
        case FlyEvent():
            vehicle.fly(event.path)
        case FollowEvent():
            vehicle.follow(event.following, transition_s=event.transition_s)
        case LeadEvent():
            vehicle.lead()


def flight_record(recording: Recording, names: list[str]) -> FlightRecord:
    """True motions, references and stations of a recorded flight, as those of the rig."""
    laboratory = [state for state, _ in recording.messages(channels.LABORATORY, channels.SIMULATOR_UNIT)]
    first = laboratory[0].frame
    motion: dict[str, Array] = {}
    for name in names:
        rows = []
        for state in laboratory:
            true = state.vehicles[name]
            velocity = turned_about_z(np.array(true.velocity_m_s), -true.yaw_rad)
            rows.append([*true.position_m, true.yaw_rad, *velocity, 0.0])
        motion[name] = np.array(rows)
    found = {}
    for name in names:
        reference, station = np.full((2, len(laboratory), 4), np.nan)
        for plan, _ in recording.messages(channels.PLAN, name):
            row = plan.frame - first
            if plan.reference is not None and 0 <= row < len(laboratory):
                reference[row] = plan.reference
                leaders = {other: rows[row] for other, rows in motion.items()}
                station[row] = station_of(plan.following, leaders)
        last = laboratory[-1].vehicles[name]
        touched = last.touchdowns - laboratory[0].vehicles[name].touchdowns
        outside = any(state.vehicles[name].outside for state in laboratory)
        time_s = PERIOD_S * np.arange(float(len(laboratory)))
        inputs = np.full((len(laboratory), 4), np.nan)
        found[name] = VehicleRecord(
            time_s, motion[name], reference, station, inputs, _fallbacks(recording, name), outside, touched
        )
    return FlightRecord(found)


def _fallbacks(recording: Recording, name: str) -> Counter[str]:
    statuses = [status.diagnostics for status, _ in recording.messages(channels.AGENT_STATUS, name)]
    return Counter(statuses[-1].fallbacks) - Counter(statuses[0].fallbacks) if statuses else Counter()


def _traffic(recording: Recording) -> MessageTraffic:
    """Number and bytes of the messages of schemes, else of the plans."""
    channel: Channel[Any] = channels.SCHEME if recording.units(channels.SCHEME) else channels.PLAN
    sizes = [len(encode(message)) for _, _, message in recording.in_order([channel])]
    return MessageTraffic(len(sizes), sum(sizes))
