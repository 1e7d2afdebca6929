"""Flight phases of a vehicle as a table: phase x event -> phase."""

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

TRANSITIONS: Final = MappingProxyType(
    {
        (Phase.GROUND, Event.ARM): Phase.ARMED,
        (Phase.GROUND, Event.RESUME): Phase.FLYING,
        (Phase.ARMED, Event.RESUME): Phase.FLYING,
        (Phase.ARMED, Event.DISARM): Phase.GROUND,
        (Phase.ARMED, Event.TAKE_OFF): Phase.TAKEOFF,
        (Phase.TAKEOFF, Event.CLIMBED): Phase.FLYING,
        (Phase.TAKEOFF, Event.NOT_LIFTED): Phase.ARMED,
        (Phase.TAKEOFF, Event.LAND): Phase.LANDING,
        (Phase.TAKEOFF, Event.DISARM): Phase.GROUND,
        (Phase.TAKEOFF, Event.OVERRIDE): Phase.EMERGENCY,
        (Phase.FLYING, Event.TAKE_OFF): Phase.TAKEOFF,
        (Phase.FLYING, Event.LAND): Phase.LANDING,
        (Phase.FLYING, Event.DISARM): Phase.GROUND,
        (Phase.FLYING, Event.OVERRIDE): Phase.EMERGENCY,
        (Phase.LANDING, Event.TOUCHED_DOWN): Phase.ARMED,
        (Phase.LANDING, Event.DISARM): Phase.GROUND,
        (Phase.LANDING, Event.OVERRIDE): Phase.EMERGENCY,
        (Phase.EMERGENCY, Event.ARM): Phase.FLYING,
        (Phase.EMERGENCY, Event.DISARM): Phase.GROUND,
        (Phase.EMERGENCY, Event.LAND): Phase.LANDING,
    }
)
"""Pairs that are not listed leave the phase as it is."""

AIRBORNE: Final = frozenset({Phase.TAKEOFF, Phase.FLYING, Phase.LANDING, Phase.EMERGENCY})


def next_phase(phase: Phase, event: Event) -> Phase:
    """Phase after an event; unchanged if the event has no effect in this phase."""
    return TRANSITIONS.get((phase, event), phase)
