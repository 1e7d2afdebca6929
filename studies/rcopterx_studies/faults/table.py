"""The table of fault flights."""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Final

from msgspec import Struct, convert

from rcopterx.simulator.faults import Fault
from rcopterx.tables import table_beside
from rcopterx_studies.faults.bench import FaultFlight, Injector
from rcopterx_studies.faults.bus_injectors import Flood, Impaired, OldMessages
from rcopterx_studies.faults.host_injectors import (
    ClockStepped,
    DiskFull,
    FleetFileBroken,
    LogsGone,
    NoDescriptors,
)
from rcopterx_studies.faults.laboratory_injectors import Draining, LaboratoryFault, WandLost, ZoneSetOnto
from rcopterx_studies.faults.process_injectors import (
    DiesAtStart,
    Halting,
    Killed,
    Pair,
    ProcessFault,
    Slow,
    Spinning,
    Starved,
    Stopped,
)
from rcopterx_studies.faults.promise import Promise, PromisedLimits
from rcopterx_studies.faults.take_off_table import TAKE_OFF_ROWS

ALL: Final = ("h1", "h2", "h3")
PROCESSES: Final = {
    "leader": "agent-h1",
    "follower": "agent-h2",
    "vicon-gateway": "tracker",
    "transmitter-gateway": "transmitters",
    "router": "router",
    "recorder": "recorder",
}
"""Processes by what they are. The simulator stands for the laboratory and gets no faults; the learner only
listens, as the recorder does."""
FLEET_WITH_WAND: Final = Path(__file__).with_name("three_and_wand.toml")
PAIR: Final = PromisedLimits(deviation_mm=300.0, silence_ms=1000.0)
BLIND: Final = PromisedLimits(deviation_mm=1000.0, silence_ms=4000.0)
"""Without poses and commands vehicles are held, and sink meanwhile."""
LIMITS: Final = {
    # A vehicle that lands with full thrust.
    "weak": PromisedLimits(deviation_mm=None, drift_mm=300.0, touchdown_m_s=1.0, silence_ms=None),
    # A vehicle that drifts because a stick does not respond, and comes down gently.
    "faulty axis": PromisedLimits(None, drift_mm=8000.0, touchdown_m_s=1.0, silence_ms=None),
    "trimmed": PromisedLimits(deviation_mm=250.0),
}


def _row(
    name: str,
    title: str,
    *injectors: Injector,
    promise: Promise = Promise.FLIES_ON,
    down: tuple[str, ...] = (),
    limits: PromisedLimits | None = None,
) -> FaultFlight:
    """Faults that vehicles survive, unless another promise says what happens to those that come down."""
    return FaultFlight(name, title, injectors, promise, down, limits)


def _of_process(what: str, process: str) -> tuple[FaultFlight, ...]:
    """Faults of a process that vehicles survive."""
    return (
        _row(f"{what}-killed", f"SIGKILL of {process}", Killed(process)),
        *(
            _row(
                f"{what}-stopped-{seconds:g}-s",
                f"SIGSTOP of {process} for {seconds:g} s",
                Stopped(process, seconds),
            )
            for seconds in (0.1, 0.5, 2.0, 30.0)
        ),
        _row(f"{what}-spins", f"The loop of {process} spins", Spinning(process)),
        _row(f"{what}-starved", f"{process} gets no processor for 0.3 s", Starved(process)),
        _slow(what, process),
        _row(
            f"{what}-dies-at-start",
            f"SIGKILL of {process}, and of its successor as soon as it is there",
            DiesAtStart(process),
        ),
    )


def _slow(what: str, process: str) -> FaultFlight:
    """A process that slows down; the router as a whole, because messages do not pass through its loop."""
    if process == "router":
        return _row(f"{what}-slow", f"{process} is stopped for 10 of 30 ms", Halting(process))
    return _row(f"{what}-slow", f"Every turn of the loop of {process} takes 10 ms longer", Slow(process))


def _crash_loop(
    what: str, promise: Promise, down: tuple[str, ...], seconds: float | None = None
) -> FaultFlight:
    """A process that does not start again, or only after some seconds."""
    title = f"{PROCESSES[what]} dies, and every successor as soon as it is there"
    fault = DiesAtStart(PROCESSES[what], None, seconds)
    return _row(f"{what}-crash-loop", title, fault, promise=promise, down=down)


PROCESS_ROWS: Final = (
    *(row for what, process in PROCESSES.items() for row in _of_process(what, process)),
    _crash_loop("leader", Promise.LANDS, ("h1",)),
    _crash_loop("follower", Promise.LANDS, ("h2",)),
    _crash_loop("vicon-gateway", Promise.LANDS_OPEN_LOOP, ALL),
    _crash_loop("transmitter-gateway", Promise.UNPROTECTED, ALL),
    # True states pass through the router as well, so it comes back at the end.
    _crash_loop("router", Promise.LANDS_OPEN_LOOP, ALL, seconds=6.0),
    _crash_loop("recorder", Promise.FLIES_ON, ()),
)


PAIRS: Final[dict[str, tuple[str, Callable[[str], ProcessFault]]]] = {
    "killed": ("SIGKILL", Killed),
    "stopped": ("SIGSTOP for 2 s", partial(Stopped, seconds=2.0)),
    "starved": ("no processor for 0.3 s", Starved),
}
"""What happens to every process, and soon after to every process."""
APART_S: Final = (0.0, 0.04, 0.08, 0.12, 0.16, 0.2)
PAIR_ROWS: Final = tuple(
    FaultFlight(
        f"pair-{kind}-{first}-{second}",
        f"{PROCESSES[first]}, and {PROCESSES[second]} {1000 * apart_s:g} ms later: {what}",
        (Pair(fault(PROCESSES[first]), fault(PROCESSES[second]), apart_s),),
        limits=PAIR,
        page_row=(f"pair-{kind}-*", f"Every process, and every process 0 to 200 ms later: {what}"),
    )
    for kind, (what, fault) in PAIRS.items()
    for number, (first, second) in enumerate(product(PROCESSES, repeat=2))
    # Each process comes after each other one at another time.
    for apart_s in (APART_S[(number + number // len(PROCESSES)) % len(APART_S)],)
)


BUS_ROWS: Final = (
    _row("bus-late", "All messages are 20 ms late", Impaired("delay_s", 0.02)),
    _row("bus-loss", "A tenth of all messages is lost", Impaired("loss", 0.1)),
    _row("bus-doubled", "Every message arrives twice", Impaired("duplicates", 1.0)),
    _row("bus-reordered", "A fifth of all messages is overtaken by later ones", Impaired("reordering", 0.2)),
    _row(
        "bus-old-messages",
        "Old poses, commands and plans are sent again, with this epoch and the last",
        OldMessages(),
    ),
    _row("bus-flood", "200 messages of nonsense per second on every key", Flood()),
)


class LaboratoryRow(Struct, frozen=True, forbid_unknown_fields=True):
    """A table of `laboratory.toml`."""

    title: str
    faults: tuple[Fault, ...]
    promise: Promise = Promise.FLIES_ON
    down: tuple[str, ...] = ()
    limits: str | None = None
    """One of `LIMITS`; None for those of the promise."""
    on_floor: bool = False

    def flight(self, name: str) -> FaultFlight:
        """Return the fault flight."""
        faults = tuple(map(LaboratoryFault, self.faults))
        limits = None if self.limits is None else LIMITS[self.limits]
        return FaultFlight(name, self.title, faults, self.promise, self.down, limits, on_floor=self.on_floor)


LABORATORY_ROWS: Final = tuple(
    convert(row, LaboratoryRow).flight(name) for name, row in table_beside(__file__, "laboratory").items()
)
DAY_ROWS: Final = (
    *(
        FaultFlight(
            name,
            f"The battery of {vehicle} falls to 0.58 of its thrust in 25 s",
            (Draining(vehicle, 0.58, 25.0),),
            Promise.LANDS,
            (vehicle,),
            LIMITS["weak"],
        )
        for name, vehicle in (("vehicle-battery", "h2"), ("leader-battery", "h1"))
    ),
    _row("zone-onto-leader", "A keep-out zone is set onto h1", ZoneSetOnto("h1")),
    _row("zone-onto-follower", "A keep-out zone is set onto h2", ZoneSetOnto("h2")),
    FaultFlight(
        "wand-lost", "A wand that h1 follows is not seen any more", (WandLost(),), fleet=FLEET_WITH_WAND
    ),
)

HOST_ROWS: Final = (
    _row("disk-full", "No process can write to files, and agent h2 dies", DiskFull(), Killed("agent-h2")),
    _row("logs-gone", "The log directory is gone, and agent h2 dies", LogsGone(), Killed("agent-h2")),
    _row(
        "clock-set-back",
        "The wall clock goes back by an hour, and the Vicon gateway dies",
        ClockStepped(-3600.0),
        Killed("tracker"),
    ),
    _row(
        "clock-set-back-and-bus-lost",
        "The wall clock goes back by an hour, and the router and the Vicon gateway die",
        ClockStepped(-3600.0),
        Killed("router"),
        Killed("tracker"),
        limits=BLIND,
    ),
    _row(
        "clock-set-forward",
        "The wall clock goes forward by a day, and the Vicon gateway dies",
        ClockStepped(86_400.0),
        Killed("tracker"),
    ),
    _row(
        "fleet-file-broken",
        "The fleet file is saved as nonsense, and agent h2 dies",
        FleetFileBroken(),
        Killed("agent-h2"),
    ),
    *(
        _row(f"{what}-without-descriptors", f"{process} can open nothing more", NoDescriptors(process))
        for what, process in PROCESSES.items()
    ),
)

ROWS: Final = (
    *PROCESS_ROWS, *PAIR_ROWS, *BUS_ROWS, *LABORATORY_ROWS, *DAY_ROWS, *HOST_ROWS, *TAKE_OFF_ROWS,
)  # fmt: skip

FAULT_FLIGHTS: Final = MappingProxyType({row.name: row for row in ROWS})  # every fault flight by name
