"""Promises of docs/safety.md that hold in every flight, checked on its frames and poses."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, Final, NamedTuple

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.messages import Applied, TransmitterStatus
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import FLYING, NAMES, NEUTRAL, THRUST, State

NEEDED: Final[tuple[Channel[Any], ...]] = (channels.APPLIED, channels.POSE, channels.TRANSMITTER_STATUS)
IN_FLIGHT: Final = frozenset(NAMES[state] for state in FLYING)
AIRBORNE_M: Final = 0.3  # above the place of take-off, in which a vehicle has not just landed
POSE_AGE_S: Final = 0.15
STATUS_WITHIN_S: Final = 1.0
EXCUSES: Final = ("serial link lost", "far outside the fence")
"""Reasons of the arbiter to end a flight in the air."""
LIMITS: Final = ArbiterLimits()


class Broken(NamedTuple):
    """A promise that a vehicle's frames break, with the arrival of the frame on the recording's clock [s]."""

    at_s: float
    vehicle: str
    promise: str


class _Frame(NamedTuple):
    message: Applied
    arrived_s: float
    height_m: float | None  # above the place of take-off; None while the vehicle is not seen


def broken_promises(recording: Recording) -> list[Broken]:
    """Return what a flight breaks, in order of time; nothing if all promises hold."""
    found = []
    for vehicle in recording.units(channels.APPLIED):
        frames = _frames(recording, vehicle)
        reasons = recording.messages(channels.TRANSMITTER_STATUS, vehicle)
        problems = (*_leases(frames), *_thrust(frames), *_ends(frames, reasons))
        found += [Broken(frame.arrived_s, vehicle, text) for frame, text in problems]
    return sorted(found)


def _frames(recording: Recording, vehicle: str) -> list[_Frame]:
    """Frames in the order in which they were written, with the height at their times."""
    poses = recording.messages(channels.POSE, vehicle)
    arrivals_s = [arrived_s for _, arrived_s in poses]
    frames, floor_m = [], 0.0
    applied = recording.messages(channels.APPLIED, vehicle)
    for message, arrived_s in sorted(applied, key=lambda one: one[0].written_s):
        newest = bisect_right(arrivals_s, arrived_s) - 1
        place = poses[newest][0].position_m if newest >= 0 else None
        if place is None or arrived_s > arrivals_s[newest] + POSE_AGE_S:
            frames.append(_Frame(message, arrived_s, None))
            continue
        if message.state not in IN_FLIGHT:
            floor_m = place[2] if not frames or _off(frames[-1]) else floor_m
        frames.append(_Frame(message, arrived_s, place[2] - floor_m))
    return frames


def _off(frame: _Frame) -> bool:
    return frame.message.state not in IN_FLIGHT


def _leases(frames: Sequence[_Frame]) -> Iterator[tuple[_Frame, str]]:
    """One lease commands: it only grows."""
    newest = 0
    for frame in frames:
        lease = frame.message.lease
        if not _off(frame) and lease < newest:
            yield frame, f"lease {lease} commands after {newest}"
        newest = max(newest, lease)


def _thrust(frames: Sequence[_Frame]) -> Iterator[tuple[_Frame, str]]:
    """Without arming there is no thrust, and after a kill only a reset."""
    for before, frame in pairwise(frames):
        was, state = before.message.state, frame.message.state
        if _off(frame) and frame.message.input != NEUTRAL:
            yield frame, f"inputs {frame.message.input} while {state}"
        if _off(before) and not _off(frame) and (state != NAMES[State.ARMED] or was == NAMES[State.KILLED]):
            yield frame, f"{state} after {was} without arming"


def _ends(
    frames: Sequence[_Frame], reasons: Iterable[tuple[TransmitterStatus, float]]
) -> Iterator[tuple[_Frame, str]]:
    """No flight of a vehicle that is seen in the air ends, except by a kill or one of `EXCUSES`."""
    excused_s = [arrived_s for status, arrived_s in reasons if status.reason.startswith(EXCUSES)]
    for before, frame in pairwise(frames):
        was, state = before.message.state, frame.message.state
        if _off(before) or not _off(frame) or state == NAMES[State.KILLED]:
            continue
        gap_s = frame.message.written_s - before.message.written_s
        late = gap_s > LIMITS.take_over_s
        if before.message.input[THRUST] <= LIMITS.low_thrust or (was == NAMES[State.DESCEND] and not late):
            continue
        in_air = frame.height_m is not None and frame.height_m > AIRBORNE_M
        if in_air and not any(abs(at_s - frame.arrived_s) < STATUS_WITHIN_S for at_s in excused_s):
            gap = f" after {gap_s:.2f} s without frames" if late else ""
            yield frame, f"{state} after {was}{gap}, {frame.height_m:.2f} m above the floor"
