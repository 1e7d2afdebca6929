"""Flies the excitation of an identification on a running fleet, and records it from the bus."""

from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.bus import channels
from rcopterx.bus.messages import Applied, Pose
from rcopterx.bus.requests import Excite
from rcopterx.control.identification.excitation import DONE, UNDER_WAY, excitation_for
from rcopterx.control.identification.recording import FlightLog, FlightRecording
from rcopterx.control.interfaces import Measurement
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.report.recorder import Recorder, Recording
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.vehicles.state import four

BEGIN_LIMIT_S: Final = 2.0
OVERDUE_S: Final = 5.0
PROGRESS_S: Final = 5.0

Progress = Callable[[float], None]
"""Called every few seconds with the time that is left [s]."""


class IdentificationError(RefusedError):
    """The flight cannot be used."""


def excited_flight(
    fleet: Observer,
    name: str,
    duration_s: float,
    strength: float = 1.0,
    reach_m: float = 0.4,
    progress: Progress = lambda _: None,
) -> FlightRecording:
    """Excite a hovering vehicle, which does not follow, and record its poses and applied sticks.

    `strength` is a fraction of the usual excitation, `reach_m` the largest distance from the set point.

    Raises
    ------
    IdentificationError
        The agent refused the excitation or ended it early, or the recording cannot be used.
    RequestFailedError
        The agent did not answer.
    """
    model = model_of(fleet.file, name)
    excitation = excitation_for(model, duration_s, strength)
    recorder = Recorder(fleet.session, only=(channels.POSE, channels.APPLIED))
    request = Excite(duration_s=duration_s, amplitude=four(np.array(excitation.amplitude)), reach_m=reach_m)
    reply = fleet.session.request(name, request)
    if not reply.accepted:
        raise IdentificationError(reply.reason)
    recorder.start()
    try:
        outcome = _wait(fleet, name, duration_s, progress)
    except BaseException:
        fleet.session.request(name, Excite(duration_s=0.0))
        raise
    recording = recorder.stop()
    if outcome != DONE:
        raise IdentificationError(f"ended early: {outcome or 'the agent was replaced'}")
    return recording_of(recording, name, model.kind, fleet.file.vehicles[name].control.period_s)


def _wait(fleet: Observer, name: str, duration_s: float, progress: Progress) -> str:
    """Wait until the excitation is over; return its outcome."""

    def outcome() -> str:
        status = fleet.state_of(name).agent
        return "" if status is None else status.excitation

    def left_s() -> float:
        status = fleet.state_of(name).agent
        return 0.0 if status is None else status.excitation_left_s

    fleet.wait_until(lambda: outcome() == UNDER_WAY, BEGIN_LIMIT_S, "the excitation does not begin", [name])
    reported_s = duration_s

    def over() -> bool:
        nonlocal reported_s
        if left_s() <= reported_s - PROGRESS_S:
            reported_s = left_s()
            progress(reported_s)
        return outcome() != UNDER_WAY

    fleet.wait_until(over, duration_s + OVERDUE_S, "the excitation does not end", [name])
    return outcome()


def recording_of(recording: Recording, name: str, kind: str, period_s: float) -> FlightRecording:
    """Flight of a vehicle of type `kind` from recorded poses and applied inputs.

    Raises
    ------
    IdentificationError
        Nothing was applied, the arbiter overrode the agent, or the motion capture restarted meanwhile.
    """
    poses = [pose for pose, _ in recording.messages(channels.POSE, name)]
    applied = [one for one, _ in recording.messages(channels.APPLIED, name) if one.fresh]
    if not poses or not applied:
        raise IdentificationError("no poses, or no commands, were on the bus")
    others = sorted({one.state for one in applied} - {"armed"})
    if others:
        raise IdentificationError(f"the arbiter was {', '.join(others)} meanwhile")
    if len({pose.epoch for pose in poses}) > 1:
        raise IdentificationError("the motion capture restarted meanwhile")
    return _log(poses, applied, kind, period_s).recording()


def _log(poses: list[Pose], applied: list[Applied], kind: str, period_s: float) -> FlightLog:
    log, first = FlightLog(kind, period_s), applied[0].frame
    frames = max(1, round(period_s / poses[0].period_s))
    for pose in poses:
        row, between = divmod(pose.frame - first, frames)
        if between == 0 and pose.position_m is not None and pose.quaternion_xyzw is not None:
            log.add_pose(row, Measurement.of_pose(pose.position_m, pose.quaternion_xyzw))
    for one in applied:
        log.add_input((one.frame - first) // frames, np.array(one.input))
    return log
