"""Flight phases of a vehicle as a table: phase x event -> phase, and what that does to its task."""

from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final


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


EVENT_OF_STATE: Final = MappingProxyType(
    {
        "armed": Event.ARM,
        "hold": Event.OVERRIDE,
        "land": Event.OVERRIDE,
        "descend": Event.OVERRIDE,
        "disarmed": Event.DISARM,
        "cut": Event.DISARM,
        "killed": Event.DISARM,
    }
)
"""Event of each state of the arbiter."""


class Effect(StrEnum):
    """What a transition does to the task of the vehicle."""

    NONE = "none"
    INTERRUPT = "interrupt"  # it continues when the transmitter gateway returns the vehicle
    CONTINUE = "continue"  # what was interrupted
    HOLD = "hold"  # the present place becomes the set point


@dataclass(frozen=True, slots=True)
class Transition:
    """One row: in any of `phases`, the event leads to `target`."""

    phases: tuple[Phase, ...]
    event: Event
    target: Phase
    effect: Effect = Effect.NONE


_P, _E = Phase, Event
TRANSITIONS: Final = (
    Transition((_P.GROUND,), _E.ARM, _P.ARMED),
    Transition((_P.GROUND, _P.ARMED), _E.RESUME, _P.FLYING, Effect.HOLD),
    Transition((_P.ARMED, _P.TAKEOFF, _P.FLYING, _P.LANDING, _P.EMERGENCY), _E.DISARM, _P.GROUND),
    Transition((_P.ARMED, _P.FLYING), _E.TAKE_OFF, _P.TAKEOFF),
    Transition((_P.TAKEOFF,), _E.CLIMBED, _P.FLYING),
    Transition((_P.TAKEOFF,), _E.NOT_LIFTED, _P.ARMED),
    Transition((_P.TAKEOFF, _P.FLYING, _P.EMERGENCY), _E.LAND, _P.LANDING),
    Transition((_P.LANDING,), _E.TOUCHED_DOWN, _P.ARMED),
    Transition((_P.TAKEOFF, _P.FLYING, _P.LANDING), _E.OVERRIDE, _P.EMERGENCY, Effect.INTERRUPT),
    Transition((_P.EMERGENCY,), _E.ARM, _P.FLYING, Effect.CONTINUE),
)
"""At most one row for a phase and an event; without one the phase stays as it is."""
_ROWS: Final = {(phase, row.event): row for row in TRANSITIONS for phase in row.phases}

AIRBORNE: Final = frozenset({Phase.TAKEOFF, Phase.FLYING, Phase.LANDING, Phase.EMERGENCY})


def transition(phase: Phase, event: Event) -> Transition | None:
    """Row of the table for an event; None if it has no effect in this phase."""
    return _ROWS.get((phase, event))
