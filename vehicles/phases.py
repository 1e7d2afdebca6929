"""Flight phases of a vehicle as a table: phase x event -> phase, and what that does to its task."""

from enum import StrEnum
from types import MappingProxyType
from typing import Final, NamedTuple

from msgspec import convert

from rcopterx.tables import table_beside


class Phase(StrEnum):
    """Flight phase."""

    # Phases in messages are plain strings, which have to be found in sets of phases.
    __hash__ = str.__hash__

    GROUND = "ground"  # not armed; thrust zero
    ARMED = "armed"  # commands reach the transmitter; standing, thrust zero
    TAKEOFF = "takeoff"
    FLYING = "flying"
    LANDING = "landing"
    EMERGENCY = "emergency"  # in the air, but the transmitter gateway brings the vehicle down by itself


class Event(StrEnum):
    """Event that may change the phase."""

    ARM = "arm"  # the transmitter gateway applies the commands of the agent
    DISARM = "disarm"  # the transmitter gateway keeps the throttle low
    TAKE_OFF = "take_off"
    NOT_LIFTED = "not_lifted"  # the rotor turned up, and the vehicle stayed on the floor
    CLIMBED = "climbed"
    LAND = "land"
    TOUCHED_DOWN = "touched_down"
    OVERRIDE = "override"  # the transmitter gateway flies by itself
    RESUME = "resume"  # an agent that restarts finds its vehicle in the air


class Effect(StrEnum):
    """What a transition does to the task of the vehicle."""

    NONE = "none"
    INTERRUPT = "interrupt"  # it continues when the transmitter gateway returns the vehicle
    CONTINUE = "continue"  # what was interrupted
    HOLD = "hold"  # the present place becomes the set point


class Transition(NamedTuple):
    """One row: in any of `phases`, the event leads to `target`."""

    phases: tuple[Phase, ...]
    event: Event
    target: Phase
    effect: Effect = Effect.NONE


_TABLE: Final = table_beside(__file__, "phases")
EVENT_OF_STATE: Final = MappingProxyType(convert(_TABLE["event_of_state"], dict[str, Event]))
"""Event of each state of the arbiter."""
TRANSITIONS: Final = convert(_TABLE["transitions"], tuple[Transition, ...])
"""At most one row for a phase and an event; without one the phase stays as it is."""
_ROWS: Final = {(phase, row.event): row for row in TRANSITIONS for phase in row.phases}

AIRBORNE: Final = frozenset({Phase.TAKEOFF, Phase.FLYING, Phase.LANDING, Phase.EMERGENCY})


def transition(phase: Phase, event: Event) -> Transition | None:
    """Row of the table for an event; None if it has no effect in this phase."""
    return _ROWS.get((phase, event))
