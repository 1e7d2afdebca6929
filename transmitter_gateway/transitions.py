"""The transition table of the arbiter: conditions x state -> state (docs/safety.md).

Of all rows that fit, the first one counts.
"""

from collections.abc import Set
from dataclasses import dataclass
from enum import StrEnum

from rcopterx.transmitter_gateway.inputs import FLYING, State


class Condition(StrEnum):
    """Conditions of transitions; the value is used in messages."""

    KILL = "kill requested"
    RESET = "reset requested"
    ARM = "arming requested"
    DISARM = "disarming requested"
    SHUTDOWN = "shutting down"
    TAKE_OVER = "found flying after a restart"
    LINK_LOST = "serial link lost"
    READY = "transmitter ready"
    FRESH = "commands fresh"
    BRIDGING = "planned inputs left to play"
    SILENT = "commands silent"
    GONE = "commands gone"
    LOW_COMMANDED = "commanded thrust low long enough"
    THRUST_WANTED = "a source asks for thrust"
    GROUNDED = "on the floor"
    IDLE = "on the floor for long"
    SEEN = "own pose seen"
    AIRBORNE = "own pose seen in the air"
    TOUCHDOWN = "touched down"
    RUNAWAY = "far outside the fence without obeying"
    IMPLAUSIBLE = "pose not plausible"
    GIVEN_UP = "flight given up"
    LIFT_OFF = "lift-off fails"
    SINKING = "lift-off fails and it sinks"
    HOLD_CAUSE = "surveillance: hold"
    DESCEND_CAUSE = "surveillance: descend"
    HOLD_OVER = "hold lasted too long"
    LANDING_OVER = "landing lasted too long"
    DESCENT_OVER = "descent lasted its time"


@dataclass(frozen=True, slots=True)
class Transition:
    """One row: in any of `states`, with all of `needs` and none of `unless`, go to `target`."""

    states: Set[State]
    needs: Set[Condition]
    target: State
    reason: str
    unless: Set[Condition] = frozenset()


def _down(
    states: Set[State], needs: Set[Condition], reason: str, unless: Set[Condition] = frozenset()
) -> tuple[Transition, Transition]:
    """Rows that bring a vehicle down: in a closed loop where it is seen in the air, else open loop."""
    seen = Transition(states, needs | {Condition.AIRBORNE}, State.LAND, reason, unless)
    return seen, Transition(states, needs, State.DESCEND, reason, unless)


_C, _S = Condition, State
NOT_KILLED = frozenset(State) - {_S.KILLED}
LIVE = FLYING | {_S.CUT}
CAUSES = {_C.HOLD_CAUSE, _C.DESCEND_CAUSE}

TRANSITIONS: tuple[Transition, ...] = (
    Transition(NOT_KILLED, {_C.KILL}, _S.KILLED, "killed"),
    Transition({_S.KILLED}, {_C.RESET}, _S.DISARMED, "kill reset", unless={_C.THRUST_WANTED}),
    Transition(LIVE, {_C.LINK_LOST}, _S.DISARMED, "serial link lost"),
    Transition({_S.CUT}, {_C.DISARM}, _S.DISARMED, "disarmed"),
    Transition(FLYING, {_C.DISARM, _C.GROUNDED}, _S.DISARMED, "disarmed"),
    Transition(FLYING, {_C.DISARM, _C.SEEN}, _S.DISARMED, "disarmed", unless={_C.AIRBORNE}),
    Transition({_S.ARMED}, {_C.IDLE}, _S.DISARMED, "on the floor for long"),
    Transition({_S.ARMED}, {_C.GIVEN_UP, _C.GROUNDED}, _S.DISARMED, "given up"),
    Transition({_S.ARMED}, {_C.IMPLAUSIBLE, _C.GROUNDED}, _S.DISARMED, "on the floor"),
    Transition({_S.ARMED}, {_C.GROUNDED}, _S.DISARMED, "transmitter not ready", unless={_C.READY}),
    Transition({_S.ARMED, _S.HOLD}, {_C.GONE}, _S.CUT, "commands gone", unless={_C.AIRBORNE}),
    Transition(FLYING, {_C.SHUTDOWN, _C.GROUNDED}, _S.CUT, "shutting down"),
    Transition(FLYING, {_C.LIFT_OFF}, _S.CUT, "lift-off"),
    Transition(FLYING - {_S.DESCEND}, {_C.SINKING}, _S.DESCEND, "lift-off"),
    Transition({_S.LAND, _S.DESCEND}, {_C.TOUCHDOWN}, _S.CUT, "landed", unless={_C.SINKING}),
    Transition({_S.LAND}, {_C.RUNAWAY}, _S.CUT, "far outside the fence"),
    *_down({_S.ARMED, _S.HOLD}, {_C.SHUTDOWN}, "shutting down"),
    *_down({_S.ARMED, _S.HOLD}, {_C.DESCEND_CAUSE}, "raw poses"),
    *_down({_S.ARMED, _S.HOLD}, {_C.SILENT}, "commands silent"),
    *_down({_S.ARMED, _S.HOLD}, set(), "transmitter not ready", unless={_C.READY}),
    *_down({_S.HOLD}, {_C.HOLD_OVER}, "hold lasted too long"),
    Transition({_S.ARMED}, {_C.HOLD_CAUSE}, _S.HOLD, "raw poses"),
    Transition({_S.ARMED}, set(), _S.HOLD, "commands late", unless={_C.FRESH, _C.BRIDGING}),
    Transition(
        {_S.HOLD, _S.LAND, _S.DESCEND},
        {_C.FRESH, _C.READY},
        _S.ARMED,
        "commands fresh again",
        unless={_C.SHUTDOWN, _C.SINKING, *CAUSES},
    ),
    Transition({_S.DESCEND}, {_C.AIRBORNE}, _S.LAND, "own pose seen", unless={_C.LANDING_OVER, _C.SINKING}),
    Transition({_S.DESCEND}, {_C.DESCENT_OVER}, _S.CUT, "descent over", unless={_C.AIRBORNE}),
    Transition({_S.LAND}, set(), _S.DESCEND, "own pose not seen", unless={_C.SEEN}),
    Transition({_S.LAND}, {_C.LANDING_OVER}, _S.DESCEND, "landing lasted too long"),
    *_down({_S.DISARMED}, {_C.TAKE_OVER}, "taken over", unless={_C.LINK_LOST}),
    Transition(
        {_S.DISARMED, _S.CUT},
        {_C.ARM, _C.READY, _C.FRESH, _C.LOW_COMMANDED},
        _S.ARMED,
        "armed",
        unless={_C.SHUTDOWN, _C.LINK_LOST, _C.IMPLAUSIBLE, *CAUSES},
    ),
)
ARMING = TRANSITIONS[-1]


def find_transition(state: State, conditions: frozenset[Condition]) -> Transition | None:
    """First row of the table that fits, or None to stay."""
    for row in TRANSITIONS:
        if state in row.states and row.needs <= conditions and row.unless.isdisjoint(conditions):
            return row
    return None
