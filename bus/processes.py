"""The kinds of processes of a fleet, as one table: what supervision, spares and lockstep decide by kind."""

from enum import Enum, auto
from typing import Final, Literal, NamedTuple


class Duty(Enum):
    """Purpose of a process, on which the limit of its watchdog depends."""

    RADIO = auto()  # vehicles in the air fall without it: a transmitter gateway
    FLIGHT = auto()  # vehicles in the air need it
    STANDBY = auto()  # a spare process
    BACKGROUND = auto()  # vehicles in the air do not need it, or not a new one (recorder, learner, simulator)


class Role(NamedTuple):
    """A kind of process."""

    name: str
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

ROLES: Final = {
    role.name: role
    for role in (
        Role(ROUTER, "host", 5, spare=True, needed_by_all=True),
        # Started before the processes whose first messages it records, stopped after them.
        Role(RECORDER, "host", 4, Duty.BACKGROUND, in_lockstep=True),
        Role(LEARNER, "host", 0, Duty.BACKGROUND, in_lockstep=True),
        Role(SIMULATOR, "host", 3, Duty.BACKGROUND),
        Role(TRACKER, "host", 2, spare=True, needed_by_all=True, in_lockstep=True),
        Role(
            TRANSMITTERS, "gateway", 1, Duty.RADIO,
            spare=True, needed_by_all=True, in_lockstep=True, knows_flying=True,
        ),
        Role(AGENT, "vehicle", 0, spare=True, in_lockstep=True, knows_flying=True),
    )
}  # fmt: skip
"""Every kind by its name, in starting order; one for each host has this name as its process, too."""

SPARE: Final = "spare"  # process that waits to replace others
SCRIPT: Final = "script"  # program that started the fleet, if time stands still while it does not wait
HOST_SERVICE: Final = "host_service"
CHECKPOINT: Final = "checkpoint"
SERVICES: Final = (HOST_SERVICE, CHECKPOINT)  # of the launcher, which take turns in lockstep
RESERVED_PROCESSES: Final = (
    *(name for name, role in ROLES.items() if role.unit == "host"), SPARE, *SERVICES, SCRIPT,
)  # fmt: skip
"""Names that no transmitter gateway may have."""
