"""The table of fault flights."""

from collections.abc import Callable
from functools import partial
from itertools import product
from types import MappingProxyType
from typing import Final

from rcopterx.simulator.faults import (
    AddNoise,
    BreakRadio,
    BreakVehicle,
    DisplacePose,
    Fault,
    Freeze,
    FreezePose,
    Occlude,
    Reset,
    ResetFrameId,
    Silence,
    SkipFrames,
    SwapSubjects,
    TurnPose,
)
from rcopterx_studies.faults.bench import FaultFlight, Injector
from rcopterx_studies.faults.bus_injectors import Flood, Impaired, OldMessages
from rcopterx_studies.faults.host_injectors import (
    ClockStepped,
    DiskFull,
    FleetFileBroken,
    LogsGone,
    NoDescriptors,
)
from rcopterx_studies.faults.laboratory_injectors import Draining, LaboratoryFault
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
BOTH: Final = ("h2", "h3")
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
PAIR: Final = PromisedLimits(deviation_mm=300.0, silence_ms=1000.0)
BLIND: Final = PromisedLimits(deviation_mm=1000.0, silence_ms=4000.0)
"""Without poses and commands vehicles are held, and sink meanwhile."""
WEAK: Final = PromisedLimits(deviation_mm=None, drift_mm=300.0, touchdown_m_s=1.0, silence_ms=None)
"""A vehicle that lands with full thrust."""
FAULTY_AXIS: Final = PromisedLimits(deviation_mm=None, drift_mm=8000.0, touchdown_m_s=1.0, silence_ms=None)
"""A vehicle that drifts because a stick does not respond, and comes down gently."""


def _row(
    name: str,
    title: str,
    *faults: Injector | Fault,
    promise: Promise = Promise.FLIES_ON,
    down: tuple[str, ...] = (),
    limits: PromisedLimits | None = None,
) -> FaultFlight:
    """Faults that vehicles survive, unless another promise says what happens to those that come down."""
    injectors = tuple(one if isinstance(one, Injector) else LaboratoryFault(one) for one in faults)
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


def _open_loop(name: str, title: str, down: tuple[str, ...], *faults: Fault) -> FaultFlight:
    """A fault after which vehicles without usable poses land open loop."""
    return _row(name, title, *faults, promise=Promise.LANDS_OPEN_LOOP, down=down)


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

BESIDE_M: Final = (0.5, 0.0, 0.0)
TURNED_RAD: Final = 2.44
POSE_ROWS: Final = (
    _row("pose-occluded-60-ms", "h2 is not seen for 60 ms", Occlude("h2", duration_s=0.06)),
    _row("pose-occluded-200-ms", "h2 is not seen for 0.2 s", Occlude("h2", duration_s=0.2)),
    _open_loop("pose-occluded", "h2 is not seen any more", ("h2",), Occlude("h2")),
    _row("tracker-frozen-200-ms", "The Tracker repeats a frame for 0.2 s", Freeze(duration_s=0.2)),
    _open_loop("tracker-frozen", "The Tracker repeats a frame for ever", ALL, Freeze()),
    _open_loop("pose-frozen", "The pose of h2 stands still, frames go on", ("h2",), FreezePose("h2")),
    _row(
        "pose-jumps-100-ms",
        "h2 is shown 0.5 m beside its place for 0.1 s",
        DisplacePose("h2", offset_m=BESIDE_M, duration_s=0.1),
    ),
    _open_loop(
        "pose-jumps", "h2 is shown 0.5 m beside its place", ("h2",), DisplacePose("h2", offset_m=BESIDE_M)
    ),
    _row(
        "pose-turned-100-ms",
        "h2 is shown turned by 140 degrees for 0.1 s",
        TurnPose("h2", yaw_rad=TURNED_RAD, duration_s=0.1),
    ),
    _row(
        "pose-turned",
        "h2 is shown turned by 140 degrees",
        TurnPose("h2", yaw_rad=TURNED_RAD),
        promise=Promise.LANDS,
        down=("h2",),
    ),
    _row(
        "pose-swapped-60-ms",
        "h2 and h3 are taken for one another for 60 ms",
        SwapSubjects("h2", other="h3", duration_s=0.06),
    ),
    _open_loop("pose-swapped", "h2 and h3 are taken for one another", BOTH, SwapSubjects("h2", other="h3")),
    _row(
        "pose-drifts",
        "The pose of h2 drifts by 30 mm/s for 3 s",
        DisplacePose("h2", velocity_m_s=(0.03, 0.0, 0.0), duration_s=3.0),
    ),
    _row("pose-noise", "Noise of 2 mm on all positions", AddNoise(deviation_m=0.002, duration_s=2.0)),
    _row(
        "tracker-half-rate", "The Tracker sends every second frame only", SkipFrames(one_of=2, duration_s=2.0)
    ),
    _row(
        "tracker-restarted-at-once",
        "The Tracker ends its connections and counts frames anew",
        ResetFrameId(),
        Reset(),
    ),
    _open_loop(
        "tracker-restarted",
        "The Tracker is silent for 3 s, ends its connections and counts frames anew",
        ALL,
        Silence(duration_s=3.0),
        ResetFrameId(),
        Reset(),
    ),
)

RADIO_ROWS: Final = (
    *(
        _row(
            f"radio-{name}",
            title,
            BreakRadio("h2", condition=condition),
            promise=Promise.UNPROTECTED,
            down=("h2",),
        )
        for name, title, condition in (
            ("cable", "The cable of h2's radio module is pulled", "unplugged"),
            ("power", "The radio module of h2 has no power", "off"),
            ("no-dsm2", "The radio module of h2 refuses its protocol", "refusing"),
        )
    ),
    _row(
        "radio-adapter-0.2-s",
        "The serial adapter of h2 is gone for 0.2 s, its module keeps its power",
        BreakRadio("h2", condition="adapter", duration_s=0.2),
    ),
)


def _lands(name: str, title: str, limits: PromisedLimits, *faults: Injector | Fault) -> FaultFlight:
    """Faults of h2 after which it lands closed loop."""
    return _row(name, title, *faults, promise=Promise.LANDS, down=("h2",), limits=limits)


VEHICLE_ROWS: Final = (
    _row(
        "vehicle-dead",
        "The rotors of h2 stop",
        BreakVehicle("h2", thrust_factor=0.0),
        promise=Promise.UNPROTECTED,
        down=("h2",),
    ),
    FaultFlight(
        "vehicle-does-not-lift",
        "Take-off of h2 with three tenths of its thrust",
        (LaboratoryFault(BreakVehicle("h2", thrust_factor=0.3)),),
        Promise.REFUSED,
        on_floor=True,
    ),
    _lands("vehicle-weak", "h2 has only 0.65 of its thrust", WEAK, BreakVehicle("h2", thrust_factor=0.65)),
    _lands(
        "vehicle-battery",
        "The battery of h2 falls to 0.58 of its thrust in 25 s",
        WEAK,
        Draining("h2", 0.58, 25.0),
    ),
    _lands(
        "vehicle-reversed-pitch",
        "The pitch stick of h2 acts the wrong way round",
        FAULTY_AXIS,
        BreakVehicle("h2", reversed="pitch"),
    ),
    _lands(
        "vehicle-stuck-roll", "The roll stick of h2 is stuck", FAULTY_AXIS, BreakVehicle("h2", stuck="roll")
    ),
    _row(
        "vehicle-drifts",
        "Pitch and roll of h2 act eight times as strongly and late for 5 s, then its roll trim steps by 0.12",
        BreakVehicle("h2", cyclic_factor=8.0, delay_s=0.08, duration_s=5.0),
        BreakVehicle("h2", trim=(0.0, 0.12, 0.0, 0.0)),
        promise=Promise.LANDS_AND_REPORTS,
        down=("h2",),
    ),
    _row(
        "vehicle-trim",
        "The roll trim of h2 steps by 0.1",
        BreakVehicle("h2", trim=(0.0, 0.1, 0.0, 0.0), duration_s=3.0),
        limits=PromisedLimits(deviation_mm=250.0),
    ),
    *(
        _row(
            f"vehicle-attitude-{name}",
            f"The attitude loop of h2 has {what} for 5 s",
            BreakVehicle("h2", attitude_gain=gain, trim=(0, roll, 0, 0), duration_s=5.0),
        )
        for name, what, gain, roll in (  # propellers, gains or sensors of a firmware that keeps the attitude
            ("weak", "half of its torque", 0.5, 0.0),
            ("strong", "one and a half of its torque", 1.5, 0.0),
            ("damaged", "0.8 of its torque, and its level is off by a sixth of the full tilt", 0.8, 0.17),
        )
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
    *PROCESS_ROWS, *PAIR_ROWS, *BUS_ROWS, *POSE_ROWS, *RADIO_ROWS, *VEHICLE_ROWS, *HOST_ROWS, *TAKE_OFF_ROWS,
)  # fmt: skip

FAULT_FLIGHTS: Final = MappingProxyType({row.name: row for row in ROWS})  # every fault flight by name
