"""Inputs and outputs of the arbiter: small typed values without behaviour."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, StrEnum

from msgspec import Struct

Input = tuple[float, float, float, float]
Position = tuple[float, float, float]
NEUTRAL: Input = (0.0, 0.0, 0.0, 0.0)
THRUST = 2  # index of the thrust


class State(StrEnum):
    """States of the arbiter (docs/safety.md)."""

    DISARMED = "DISARMED"
    ARMED = "ARMED"
    HOLD = "HOLD"
    LAND = "LAND"
    DESCEND = "DESCEND"
    CUT = "CUT"
    KILLED = "KILLED"


NAMES = {state: state.value.lower() for state in State}  # states as messages call them
FLYING = frozenset({State.ARMED, State.HOLD, State.LAND, State.DESCEND})


class LinkState(Enum):
    """State of the way to the vehicle: port closed, port open, port open and module ready."""

    LOST = "lost"
    UP = "up"
    READY = "ready"


class Action(StrEnum):
    """Kind of a request."""

    ARM = "arm"
    DISARM = "disarm"
    KILL = "kill"
    RESET = "reset"
    SHUTDOWN = "shutdown"


class CommandInput(Struct, frozen=True):
    """A command as received; nothing in it is trusted before admission.

    `epoch` and `frame` stamp the pose that it was computed from; `next_u` are the planned inputs of the
    following periods, shape (k, 4).
    """

    lease: int
    epoch: int
    sequence: int
    frame: int
    u: Sequence[float]
    next_u: Sequence[Sequence[float]] = ()
    period_s: float = 0.02


class PoseInput(Struct, frozen=True):
    """A raw pose from motion capture; `position_m` is None when the vehicle is occluded.

    Without `period_s` the arrival times are used; without `yaw_rad` the vehicle cannot be held or landed in a
    closed loop; `latency_s` is the time from capture to arrival, as far as the Tracker reports it.
    """

    vehicle: str
    epoch: int
    frame: int
    position_m: Position | None
    period_s: float | None = None
    yaw_rad: float | None = None
    latency_s: float = 0.0


class ActionRequest(Struct, frozen=True):
    """A request, and by whom."""

    action: Action
    by: str


class LastApplied(Struct, frozen=True):
    """What a process of this gateway wrote last, for its successor; `written_s` is on the monotonic clock.

    `hover_thrust` is the learned one; `commanded`: commands count; `mistaken`: the own poses may be those of
    another body; `ready`: the module was ready; `grounded`: the thrust had been low for so long that the
    vehicle stood on the floor.
    """

    state: State
    u: Input
    written_s: float
    lease: int
    issued: int
    hover_thrust: float
    commanded: bool = False
    mistaken: bool = False
    ready: bool = False
    grounded: bool = False


class Answer(Struct, frozen=True):
    """Whether a request or a command was accepted, and why."""

    accepted: bool
    reason: str


class Cause(Struct, frozen=True):
    """Identity of the command that an output comes from."""

    lease: int
    epoch: int
    sequence: int
    frame: int


class ArbiterOutput(Struct, frozen=True):
    """Decision of the arbiter: inputs after limits and slew, or throttle low, free of trim, and the kill
    channel.

    `bridging_step` is the number of the planned input that is played because commands are late, else 0.
    `cause` is the command behind `u`, None when it comes from the arbiter alone.
    """

    state: State
    reason: str
    u: Input = NEUTRAL
    throttle_low: bool = False
    kill: bool = False
    bridging_step: int = 0
    cause: Cause | None = None
