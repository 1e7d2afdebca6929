"""A recorded flight of two vehicles with known states at known times, for films and reports."""

from collections.abc import Iterator
from typing import Any

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.log_messages import AnsweredRequest
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied, LeaderLink, Pose, TransmitterStatus
from rcopterx.bus.requests import Reply, TakeOff
from rcopterx.bus.session import RawMessage
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.report.logged_flight import LoggedFlight, flight_of
from rcopterx.ground_station.report.recorder import Recording
from support.plans import plan_of
from support.statuses import flying_status

FLEET = parse_fleet(
    """
name = "pair"
[vehicles.h1]
subject = "h1"
transmitter = { port = "radio-h1" }
[vehicles.h2]
subject = "h2"
transmitter = { port = "radio-h2" }
follow = [{ leader = "h1", offset_m = [0.0, 0.5, 0.0] }]
"""
)
STARTED_S = 100.0  # on the clock of the recording
TAKES_OFF_S, FLIES_S, LANDS_S, LANDED_S, ENDS_S = 1.0, 2.0, 8.0, 9.0, 10.0
READY = TransmitterStatus(state="armed", reason="", link="open", module="ready", ready=True)
LINK = LeaderLink(leader="h1", offset_m=(0.0, 0.5, 0.0))
STEP_S = 0.1


def at(time_s: float, channel: Channel[Any], message: Message, unit: str = "h1") -> RawMessage:
    """A message that arrived at a time from the beginning of the flight."""
    return RawMessage(unit, channel.topic, encode(message), STARTED_S + time_s)


def phase_at(time_s: float) -> str:
    ends = (("ground", TAKES_OFF_S), ("takeoff", FLIES_S), ("flying", LANDS_S), ("landing", LANDED_S))
    return next((phase for phase, end_s in ends if time_s < end_s), "ground")


def vehicle_at(name: str, time_s: float) -> Iterator[RawMessage]:
    """Messages of a vehicle that flies along x at 0.1 m/s; h2 follows h1, 20 mm from its place."""
    step, phase = round(time_s / STEP_S), phase_at(time_s)
    links = (LINK,) if name == "h2" else ()
    height_m = 0.0 if phase == "ground" else 1.0
    place = (0.1 * time_s, 0.5 if links else 0.0, height_m)
    wanted = (place[0], place[1] + (0.02 if links else 0.0), height_m)
    pose = Pose(
        epoch=1, frame=step, period_s=STEP_S, latency_s=0.0, received_s=time_s, occluded=False,
        position_m=place, quaternion_xyzw=(0.0, 0.0, 0.0, 1.0),
    )  # fmt: skip
    plan = plan_of(
        name, step, position_m=place, reference_m=wanted, following=links, start_s=0.0,
        airborne=phase != "ground",
    )  # fmt: skip
    applied = Applied(
        state="armed", input=(0.0, 0.0, 0.5, 0.0), pulse_width_us=(1500.0,), epoch=1, frame=step,
        sequence=step, fresh=True, command_arrived_s=None, written_s=time_s, host="main", timing=None,
    )  # fmt: skip
    status = flying_status(position_m=place, phase=phase, following=links, assigned=links, pose_age_s=0.01)
    yield at(time_s, channels.POSE, pose, name)
    yield at(time_s, channels.PLAN, plan, name)
    yield at(time_s, channels.APPLIED, applied, name)
    yield at(time_s, channels.AGENT_STATUS, status, name)
    yield at(time_s, channels.TRANSMITTER_STATUS, READY, name)


def messages(seconds: float = ENDS_S, silent_s: tuple[float, float] = (0.0, 0.0)) -> list[RawMessage]:
    """All messages in order; nothing arrives in an interval."""
    times_s = [step * STEP_S for step in range(round(seconds / STEP_S))]
    records = [
        record
        for time_s in times_s
        if not silent_s[0] <= time_s < silent_s[1]
        for name in FLEET.vehicles
        for record in vehicle_at(name, time_s)
    ]
    reply, request = encode(Reply(accepted=True)), encode(TakeOff(height_m=1.0))
    answered = AnsweredRequest(verb="take_off", request=request, reply=reply, took_s=0.0)
    return sorted([*records, at(TAKES_OFF_S, channels.ANSWERED, answered)], key=lambda one: one.arrived_s)


def filmed_flight(name: str = "pair-1") -> LoggedFlight:
    """The flight for a report."""
    return flight_of(name, FLEET, Recording(messages()), {"started": "2026-11-29T08:04:01+0000"})
