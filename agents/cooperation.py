"""Messages of a vehicle's scheme: what it receives, with the offsets of the formation, and what it sends."""

from collections import Counter
from collections.abc import Mapping
from typing import Final, NamedTuple

import msgspec
import numpy as np
from msgspec import Struct

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.guards.step_guard import StepGuard
from rcopterx.control.interfaces import Controller, Estimate
from rcopterx.control.plugins import all_finite
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.control.scheme import MAX_MESSAGE_BYTES, Neighbour, Scheme, Situation
from rcopterx.vehicles.state import Array, turned_about_z

MOST_EXCHANGES: Final = 8
SILENT_S: Final = 1.0  # vehicles whose messages are older are unknown to the others


class Unpacked(NamedTuple):
    """Newest message of another vehicle's scheme."""

    message: Struct
    age_s: float
    offset_m: Array | None
    """Where its sender should be relative to this vehicle, inertial frame; None if it does not follow it."""


class Sent(NamedTuple):
    """What a vehicle sends to all others."""

    scheme: str
    payload: bytes
    offsets_m: Mapping[str, Array]
    """Where the vehicle should be relative to each of its leaders, inertial frame, shape (3,)."""


class Cooperation:
    """Exchanges of one vehicle's controller, if that is a scheme; failures count as those of its steps."""

    def __init__(self, guidance: Guidance, step_guard: StepGuard, clock: FleetClock) -> None:
        self._guidance = guidance
        self.step_guard = step_guard
        self.clock = clock
        self.vehicle = ""  # name of the vehicle
        self.scheme: Scheme | None = None
        self.exchanges = 1  # in a control period
        self.rejected: Counter[str] = Counter()  # received messages that cannot be used, by reason
        self._estimate: Estimate | None = None
        self._reference: Trajectory | None = None

    def use(self, controller: Controller) -> None:
        """Change to another controller."""
        self.scheme = scheme = controller if isinstance(controller, Scheme) else None
        self.exchanges = 1 if scheme is None else min(max(int(scheme.exchanges), 1), MOST_EXCHANGES)
        self._guidance.coordinated = scheme is not None

    def unpack(self, scheme: str, payload: bytes, offset_m: Array | None, age_s: float) -> Unpacked | None:
        """Unpack a message; None if it is of another scheme, or rejected and counted."""
        if self.scheme is None or scheme != _name(self.scheme):
            return None
        try:
            plain = msgspec.msgpack.decode(payload)
            if not all_finite(plain):
                raise ValueError("a number is not finite")
            return Unpacked(msgspec.convert(plain, self.scheme.Message), age_s, offset_m)
        except (ValueError, RecursionError):
            self.rejected["scheme.payload"] += 1
            return None

    def begin_period(self, estimate: Estimate, reference: Trajectory) -> None:
        """Set what the exchanges of a control period start from."""
        self._estimate, self._reference = estimate, reference

    def rest(self) -> None:
        """Exchange nothing until the next control period begins: the vehicle stands."""
        self._estimate = self._reference = None

    def exchange(self, received: Mapping[str, Unpacked], ahead_s: float = 0.0) -> Sent | None:
        """Exchange messages some time after the present frame; return what to send, None for nothing.

        A message that is too large is a failure of the scheme.
        """
        scheme, estimate, reference = self.scheme, self._estimate, self._reference
        if scheme is None or estimate is None or reference is None:
            return None
        clock = self.clock
        offsets = self._offsets(float(reference.yaw_rad[0]), clock.time_s + ahead_s)
        time_s = clock.current_frame * clock.period_s + ahead_s
        neighbours = _neighbours(received, offsets)
        situation = Situation(self.vehicle, time_s, estimate, reference, neighbours)
        payload = self.step_guard.try_exchange(1.0 / self.exchanges, _payload, scheme, situation)
        return Sent(_name(scheme), payload, offsets) if payload else None

    def _offsets(self, yaw_rad: float, time_s: float) -> dict[str, Array]:
        """Present offsets to the leaders; those that turn with a leader turn with this vehicle's heading."""
        found = {}
        for link in self._guidance.task.followed:
            offset = link.offset_at(time_s)
            turn_rad = yaw_rad - offset.yaw_rad if offset.frame == "heading" else 0.0
            found[link.leader] = turned_about_z(offset.position_m, turn_rad)
        return found


def _payload(scheme: Scheme, situation: Situation) -> bytes:
    """Return the message of a scheme, encoded; empty for none."""
    message = scheme.exchange(situation)
    if message is None:
        return b""
    payload = msgspec.msgpack.encode(message)
    if len(payload) > MAX_MESSAGE_BYTES:
        raise ValueError(f"a message of {len(payload)} bytes, allowed are {MAX_MESSAGE_BYTES}")
    return payload


def _name(scheme: Scheme) -> str:
    """Name by which messages of the same scheme are recognised."""
    return type(scheme).__name__[:60]


def _neighbours(received: Mapping[str, Unpacked], offsets: Mapping[str, Array]) -> dict[str, Neighbour]:
    found = {name: Neighbour(None, np.inf, offset, True) for name, offset in offsets.items()}
    for name, (message, age_s, offset) in received.items():
        own = offsets.get(name)
        wanted = own if own is not None or offset is None else -offset
        known = message if age_s < SILENT_S else None
        found[name] = Neighbour(known, age_s, wanted, own is not None)
    return found
