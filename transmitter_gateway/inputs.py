"""Inputs and outputs of the arbiter: small typed values without behaviour."""

import math
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
ON_THE_WAY_DOWN = frozenset({State.LAND, State.DESCEND})


class LinkState(Enum):
    """State of the way to the vehicle: port closed, port open, port open and module ready."""

    LOST = "lost"
    UP = "up"
    READY = "ready"


class Link(Struct, frozen=True):
    """Way to the vehicle, its module or what is wrong with it in words, and whether an arming lasts."""

    state: LinkState
    text: str
    armed: bool | None  # see `ModuleStatus`


class Action(StrEnum):
    """Kind of a request."""

    ARM = "arm"
    DISARM = "disarm"
    KILL = "kill"
    RESET = "reset"
    SHUTDOWN = "shutdown"


FOR_OPERATORS = {
    Action.ARM: "only an operator may arm",
    Action.DISARM: "only an operator may disarm",
    Action.RESET: "only an operator may reset a kill",
}
"""Actions for operators only, and the reason given to others; kill and shutdown are for anyone."""


class CommandInput(Struct, frozen=True):
    """A command as received, from the pose of `epoch` and `frame`; not trusted before it is validated."""

    lease: int
    epoch: int
    sequence: int
    frame: int
    u: Sequence[float]
    next_u: Sequence[Sequence[float]] = ()  # planned inputs of the following periods, shape (k, 4)
    period_s: float = 0.02
    given_up: str | None = None  # why the agent has given up the flight of a vehicle that stands


class PoseInput(Struct, frozen=True):
    """A raw pose from motion capture."""

    vehicle: str
    epoch: int
    frame: int
    position_m: Position | None  # None when the vehicle is occluded
    period_s: float | None = None  # None: the arrival times are used
    yaw_rad: float | None = None  # without it the vehicle cannot be held or landed in a closed loop
    latency_s: float = 0.0  # from capture to arrival, as far as the Tracker reports it
    tilt_rad: float | None = None  # between the axis of the vehicle and the vertical


class ActionRequest(Struct, frozen=True):
    """A request, and by whom."""

    action: Action
    by: str


class Track(Struct, array_like=True):
    """Newest pose of a vehicle and its newest accepted position; a gateway writes to it."""

    epoch: int
    frame: int
    arrived_s: float
    position_m: Position | None = None
    seen_s: float = -math.inf
    seen_frame: int = 0
    seen_epoch: int = 0
    velocity_m_s: Position = (0.0, 0.0, 0.0)  # low-passed; this and the following of the own vehicle only
    yaw_rad: float | None = None
    turned_s: float | None = None  # since when the heading has jumped; `yaw_rad` is the one before
    captured_s: float = -math.inf  # on the local clock
    occluded: bool = False  # whether the motion capture lost it since the newest accepted position
    undelivered_s: float = 0.0  # longest time since then for which frames were captured, but did not arrive


class LastApplied(Struct, frozen=True, array_like=True):
    """What a process of this gateway wrote last, for its successor (`state_page`)."""

    state: State
    u: Input
    written_s: float  # on the monotonic clock
    lease: int
    issued: int
    hover_thrust: float  # the learned one
    commanded: bool = False  # whether commands count
    mistaken: bool = False  # whether the own poses may be those of another body
    ready: bool = False  # whether the module was ready
    grounded: bool = False  # whether low thrust has lasted so long that the vehicle stood on the floor
    watched: bool = False  # whether a watchdog of the firmware waits for frames
    lifted: bool = True  # whether its pose had proved the lift-off
    hover_known_s: float = 0.0  # for how long it was seen in the air
    track: Track | None = None  # own poses of a vehicle that flies, which those of the successor continue


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
    """Decision of the arbiter: inputs after limits and slew, which count in states of `FLYING` only."""

    state: State
    u: Input = NEUTRAL
    bridging_step: int = 0  # number of the planned input played because commands are late, else 0
    cause: Cause | None = None  # command behind `u`, None when it comes from the arbiter alone

    @property
    def commanded(self) -> bool:
        """Whether a command that is not late is behind it."""
        return self.cause is not None and not self.bridging_step
