"""The transition table of the arbiter: conditions x state -> state (docs/safety.md).

Of all rows that fit, the first one counts.
"""

from collections.abc import Iterator, Set
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Final

from rcopterx.tables import table_beside
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


_GROUPS: Final = {"FLYING": FLYING, "NOT_KILLED": frozenset(State) - {State.KILLED}}
DOWN: Final = "DOWN"  # target LAND of a vehicle that is seen in the air, and DESCEND of any other


def _rows() -> Iterator[Transition]:
    """Yield the rows of `transitions.toml`."""
    for states, needs, unless, target, reason in table_beside(__file__, "transitions")["transitions"]:
        found = frozenset[State]().union(*(_GROUPS.get(name) or {State(name)} for name in states))
        row = partial(Transition, found, reason=reason, unless=frozenset(map(Condition, unless)))
        given = frozenset(map(Condition, needs))
        if target == DOWN:
            yield row(given | {Condition.AIRBORNE}, State.LAND)
        yield row(given, State.DESCEND if target == DOWN else State(target))


TRANSITIONS: Final = tuple(_rows())
ARMING = TRANSITIONS[-1]


def find_transition(state: State, conditions: frozenset[Condition]) -> Transition | None:
    """First row of the table that fits, or None to stay."""
    for row in TRANSITIONS:
        if state in row.states and row.needs <= conditions and row.unless.isdisjoint(conditions):
            return row
    return None
