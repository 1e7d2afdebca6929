"""Flies excitations for an identification on a running fleet, and records them from the bus."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, SetPoint
from rcopterx.bus.requests import Excite
from rcopterx.control.identification.excitation import COMBS, DONE, UNDER_WAY, excitation_for
from rcopterx.control.identification.recording import FlightRecording, RecordingError
from rcopterx.control.interfaces import Measurement
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.flights.ordinary_flight import recording_of
from rcopterx.ground_station.identification.spacing import IdentificationError, spread, usual_reach
from rcopterx.ground_station.report.recorder import FlightSampler, Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.room import present_room
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS
from rcopterx.vehicles.state import four

BEGIN_LIMIT_S: Final = 2.0
OVERDUE_S: Final = 5.0
PROGRESS_S: Final = 5.0
ARRIVAL_S: Final = 20.0
# In weather, vehicles that hover were within 2.3 degrees and 25 mm rms of their mean; in a limit cycle
# emulated autopilots swung by 4.7 degrees and more, ArduCopter and PX4 in software by 15 to 18.
WATCHED_S: Final = 3.0
SWING_RAD: Final = 0.06
SWING_M: Final = 0.08

Progress = Callable[[float], None]  # called every few seconds with the time that is left [s]


class Wanted(NamedTuple):
    """How vehicles are excited."""

    duration_s: float
    strength: float = 1.0  # fraction of the usual excitation
    reach_m: float = 0.4  # largest distance from the set point on every axis


class Apart(NamedTuple):
    """Vehicles that hover apart."""

    reach_m: float  # how far each one may move
    not_back: dict[str, str]  # why vehicles did not return to their formation; filled at the end


@contextmanager
def room_for_all(fleet: Fleet, names: Sequence[str], reach_m: float | None) -> Iterator[Apart]:
    """Let vehicles hover apart, without leaders, then return to formation; `IdentificationError`.

    They have room for `reach_m`, by default for as much as is usual and fits into the flight volume.
    """
    states = {name: fleet.state_of(name) for name in names}
    flying = {name: state.agent for name, state in states.items() if state.agent and state.phase == "flying"}
    if standing := [name for name in names if name not in flying]:
        raise IdentificationError(f"{', '.join(standing)}: must hover (rcopterx takeoff)")
    homes = {
        name: SetPoint(position_m=status.position_m, yaw_rad=status.yaw_rad or 0.0)
        if states[name].assigned and status.position_m
        else status.set_point
        for name, status in flying.items()
    }
    places = {name: home.position_m for name, home in homes.items()}
    room = present_room(fleet, names[0])
    reach_m = reach_m or usual_reach(len(names), room)
    apart = spread(places, reach_m, room)
    not_back: dict[str, str] = {}
    try:
        for name, state in states.items():
            if state.assigned:
                fleet[name].lead()
        for name, place_m in apart.items():
            fleet[name].go_to(place_m, homes[name].yaw_rad)
        fleet.wait_for_arrival(names, timeout_s=ARRIVAL_S)
        yield Apart(reach_m, not_back)
    finally:
        # Each one first returns to its place, where its followers find room behind it.
        present = [name for name in names if fleet.state_of(name).phase == "flying"]
        for name in present:
            _attempt(partial(fleet[name].go_to, places[name], homes[name].yaw_rad), name, not_back)
        arriving = [name for name in present if name not in not_back]
        _attempt(partial(fleet.wait_for_arrival, arriving, timeout_s=ARRIVAL_S), "formation", not_back)
        for name in present:
            if states[name].assigned:
                _attempt(partial(fleet[name].follow, states[name].assigned), name, not_back)


def _attempt(request: Callable[[], object], name: str, failures: dict[str, str]) -> None:
    try:
        request()
    except FLIGHT_ERRORS as error:
        failures[name] = str(error)


def swinging(fleet: Observer, names: Sequence[str]) -> dict[str, str]:
    """Watch vehicles that hover; return why some are not to be excited: a limit cycle falsifies a fit."""
    recorder = FlightSampler(fleet.session, only=(channels.POSE,))
    recorder.start()
    fleet.wait(WATCHED_S)
    recording = recorder.stop()
    found = {name: swing_of(recording, name) for name in names}
    return {name: problem for name, problem in found.items() if problem is not None}


def swing_of(recording: Recording, name: str) -> str | None:
    """Return by how much a vehicle swings around its mean place and heading, if it is too much."""
    seen = [
        Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
        for pose, _ in recording.messages(channels.POSE, name)
        if pose.position_m is not None and pose.quaternion_xyzw is not None
    ]
    if not seen:
        return None
    away_m = float(np.std([one.position_m for one in seen], axis=0).max())
    turned_rad = float(np.std(np.unwrap([one.yaw_rad for one in seen])))
    if away_m <= SWING_M and turned_rad <= SWING_RAD:
        return None
    swing = f"{1e3 * away_m:.0f} mm and {math.degrees(turned_rad):.0f} degrees rms around its mean"
    return f"it does not rest, but swings by {swing}: soften its controller or correct its model first"


def excited_flights(
    fleet: Observer, names: Sequence[str], wanted: Wanted, progress: Progress = lambda _: None
) -> tuple[dict[str, FlightRecording], dict[str, str]]:
    """Excite hovering vehicles at the same time; return recordings, and why other flights are of no use."""
    recordings: dict[str, FlightRecording] = {}
    failures: dict[str, str] = {}
    recorder = FlightSampler(fleet.session, only=(channels.POSE, channels.APPLIED))
    begun: list[str] = []
    try:
        for index, name in enumerate(names):
            model, duration_s = model_of(fleet.file, name), wanted.duration_s
            excitation = excitation_for(model, duration_s, wanted.strength, index % COMBS)
            sticks, comb = four(np.array(excitation.amplitude)), excitation.comb
            request = Excite(duration_s=duration_s, amplitude=sticks, reach_m=wanted.reach_m, comb=comb)
            reply = fleet.session.request(name, request)
            if reply.accepted:
                begun.append(name)
            else:
                failures[name] = reply.reason
        recorder.start()
        outcomes = _wait(fleet, begun, wanted.duration_s, progress) if begun else {}
    except BaseException:
        for name in begun:
            _attempt(partial(fleet.session.request, name, Excite(duration_s=0.0)), name, failures)
        raise
    recording = recorder.stop()
    for name, outcome in outcomes.items():
        vehicle, period_s = model_of(fleet.file, name), fleet.file.vehicles[name].control.period_s
        try:
            if outcome != DONE:
                raise IdentificationError(f"ended early: {outcome or 'the agent was replaced'}")
            recordings[name] = recording_of(
                [pose for pose, _ in recording.messages(channels.POSE, name)],
                [one for one, _ in recording.messages(channels.APPLIED, name)],
                vehicle.kind,
                period_s,
            )
        except (IdentificationError, RecordingError) as error:
            failures[name] = str(error)
    return recordings, failures


def _wait(fleet: Observer, names: Sequence[str], duration_s: float, progress: Progress) -> dict[str, str]:
    """Wait until the excitations are over; return their outcomes."""
    begun: set[str] = set()
    reported_s = duration_s

    def statuses() -> dict[str, AgentStatus]:
        return {name: status for name in names if (status := fleet.state_of(name).agent) is not None}

    def all_begun() -> bool:
        begun.update(name for name, status in statuses().items() if status.excitation == UNDER_WAY)
        return len(begun) == len(names)

    def over() -> bool:
        nonlocal reported_s
        left_s = max(status.excitation_left_s for status in statuses().values())
        if left_s <= reported_s - PROGRESS_S:
            reported_s = left_s
            progress(left_s)
        return all(status.excitation != UNDER_WAY for status in statuses().values())

    fleet.wait_until(all_begun, BEGIN_LIMIT_S, "the excitation does not begin", names)
    fleet.wait_until(over, duration_s + OVERDUE_S, "the excitation does not end", names)
    return {name: status.excitation for name, status in statuses().items()}
