"""The kinds of processes of a fleet, as one table: what supervision, spares and lockstep decide by kind."""

from enum import Enum
from typing import Final, Literal

from msgspec import Struct, convert

from rcopterx.tables import table_beside


class Duty(Enum):
    """Purpose of a process, on which the limit of its watchdog depends."""

    RADIO = "radio"  # vehicles in the air fall without it: a transmitter gateway
    FLIGHT = "flight"  # vehicles in the air need it
    STANDBY = "standby"  # a spare process
    BACKGROUND = "background"  # vehicles in the air need none, or no new one: recorder, learner, simulator


class Role(Struct, frozen=True):
    """A kind of process."""

    unit: Literal["host", "gateway", "vehicle"]  # what one process serves
    stop_order: int  # processes with lower numbers are stopped first
    duty: Duty = Duty.FLIGHT
    spare: bool = False  # whether a spare can take over from it, because vehicles in the air need it
    # whether the last spare is kept for it: without it the whole fleet loses poses or commands, while a
    # vehicle without its agent is held and landed in a closed loop
    needed_by_all: bool = False
    in_lockstep: bool = False  # whether no time passes without it
    knows_flying: bool = False  # whether it knows that vehicles fly


AGENT: Final = "agent"
TRANSMITTERS: Final = "transmitters"  # transmitter gateways
TRACKER: Final = "tracker"
SIMULATOR: Final = "simulator"  # in lockstep it advances the time
RECORDER: Final = "recorder"  # of the flight log
LEARNER: Final = "learner"  # of models of vehicles
ROUTER: Final = "router"

ROLES: Final = convert(table_beside(__file__, "processes"), dict[str, Role])
"""Every kind by its name, in starting order; one for each host has this name as its process, too."""

SPARE: Final = "spare"  # process that waits to replace others
SCRIPT: Final = "script"  # program that started the fleet, if time stands still while it does not wait
HOST_SERVICE: Final = "host_service"
CHECKPOINT: Final = "checkpoint"
SERVICES: Final = (HOST_SERVICE, CHECKPOINT)  # of the launcher, which take turns in lockstep
_OF_HOSTS: Final = [name for name, role in ROLES.items() if role.unit == "host"]
RESERVED_PROCESSES: Final = (*_OF_HOSTS, SPARE, *SERVICES, SCRIPT)
"""Names that no transmitter gateway may have."""
