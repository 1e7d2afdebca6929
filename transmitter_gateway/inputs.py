"""What the arbiter is told and what it answers: small typed values without behaviour.

They are made for every message, and `Struct` makes them in a tenth of the time of a frozen dataclass.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, StrEnum

from msgspec import Struct

Input = tuple[float, float, float, float]
Position = tuple[float, float, float]
NEUTRAL: Input = (0.0, 0.0, 0.0, 0.0)
THRUST = 2
"""Index of the thrust."""


class State(StrEnum):
    """States of the arbiter (docs/safety.md)."""

    DISARMED = "DISARMED"
    ARMED = "ARMED"
    HOLD = "HOLD"
    LAND = "LAND"
    DESCEND = "DESCEND"
    CUT = "CUT"
    KILLED = "KILLED"

    # An enumeration's own hash is a Python function, and states are looked up all the time.
    __hash__ = str.__hash__


NAMES = {state: state.value.lower() for state in State}
"""States as messages call them."""
FLYING = frozenset({State.ARMED, State.HOLD, State.LAND, State.DESCEND})


class LinkState(Enum):
    """State of the way to the vehicle: port closed, port open, port open and module ready."""

    LOST = "lost"
    UP = "up"
    READY = "ready"


class Action(StrEnum):
    """What a request asks for."""

    ARM = "arm"
    DISARM = "disarm"
    KILL = "kill"
    RESET = "reset"
    SHUTDOWN = "shutdown"


class CommandInput(Struct, frozen=True):
    """A command as received; nothing in it is trusted before admission.

    Parameters
    ----------
    lease : int
        Control lease of the agent that sends it.
    epoch, frame : int
        Pose frame it was computed from.
    sequence : int
        Grows with every command of a lease.
    u : sequence of float, shape (4,)
        Normalised inputs (pitch, roll, thrust, yaw).
    next_u : sequence of sequences of float, shape (k, 4)
        Planned inputs of the following periods.
    period_s : float
        Command period [s].
    """

    lease: int
    epoch: int
    sequence: int
    frame: int
    u: Sequence[float]
    next_u: Sequence[Sequence[float]] = ()
    period_s: float = 0.02


class PoseInput(Struct, frozen=True):
    """A raw pose from motion capture.

    Parameters
    ----------
    vehicle : str
        Whose pose it is.
    epoch, frame : int
        Stream epoch and frame number.
    position_m : tuple of float or None
        Position in the inertial frame [m]; None when occluded.
    period_s : float or None
        Frame period [s] if known; without it the arrival times are used.
    yaw_rad : float or None
        Heading [rad]; without it the vehicle cannot be held or landed in a closed loop.
    latency_s : float
        From capture to arrival, as far as the Tracker tells [s].
    """

    vehicle: str
    epoch: int
    frame: int
    position_m: Position | None
    period_s: float | None = None
    yaw_rad: float | None = None
    latency_s: float = 0.0


class PoseStamp(Struct, frozen=True):
    """Which frame the newest raw pose is from, and how late it arrived.

    Parameters
    ----------
    epoch, frame : int
        Stream epoch and frame number.
    period_s : float or None
        Frame period [s] if known.
    latency_s : float
        From capture to arrival [s].
    """

    epoch: int
    frame: int
    period_s: float | None = None
    latency_s: float = 0.0


class ActionRequest(Struct, frozen=True):
    """A request, and by whom."""

    action: Action
    by: str


class LastApplied(Struct, frozen=True):
    """What an earlier process of this gateway wrote last.

    Parameters
    ----------
    state : State
        State of its arbiter.
    u : tuple of float
        Inputs it applied.
    written_s : float
        When it wrote them, on the local clock [s]; never later than the truth by more than the bus takes.
    lease : int
        Control lease whose commands counted.
    issued : int
        Newest control lease that was heard of.
    """

    state: State
    u: Input
    written_s: float
    lease: int
    issued: int


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
    """What the vehicle is to do now.

    Parameters
    ----------
    state : State
        State of the arbiter.
    reason : str
        Why it is in this state.
    u : tuple of float
        Inputs after limits and slew.
    throttle_low : bool
        Send throttle low, free of trim.
    kill : bool
        Send the kill channel.
    bridging_step : int
        0, or the number of the planned input being played because commands are late.
    cause : Cause or None
        Command behind `u`, None when it comes from the arbiter alone.
    """

    state: State
    reason: str
    u: Input = NEUTRAL
    throttle_low: bool = False
    kill: bool = False
    bridging_step: int = 0
    cause: Cause | None = None
