"""States of processes that serve a whole host or fleet: Vicon gateway, simulator, launcher, router."""

from typing import Annotated, ClassVar

from msgspec import Meta, Struct, field

from rcopterx.bus.message import Clock, Colour, Count, Message, Name, Number, Seconds, Text, Three


class SubjectState(Struct, frozen=True, kw_only=True):
    """One subject of the Tracker."""

    subject: Text
    vehicle: Name | None = None
    """Absent for a subject that the fleet file does not name."""
    listed: bool = True
    """False for a subject of the fleet file that the Tracker does not know."""
    occluded_s: Seconds | None = None
    """How long the subject has been listed but not seen."""
    ambiguous: bool = False
    """The Tracker lists several subjects of this name; no pose is published then."""
    shown_at_m: Three | None = None
    """Where the Tracker shows it, if that is in no room; its poses are published without a position then."""
    same_place_as: Text = ""
    """Another subject that is shown at the same place; empty for none."""


class TrackerStatus(Message, frozen=True, kw_only=True):
    """State of the connection to the motion capture."""

    state: Name
    trying: Text
    """What the gateway does to get a stream, as text."""
    address: Text
    epoch: Count = 0
    frame: Count = 0
    period_s: Seconds = 0.0
    latency_s: Seconds = 0.0
    subjects: tuple[SubjectState, ...] = ()
    counters: dict[str, Count] = field(default_factory=dict)
    realtime: bool = False
    recording: Text = ""
    """The raw recording, or why it ended; empty without one."""


class LaboratoryVehicle(Struct, frozen=True, kw_only=True):
    """True state of one simulated vehicle."""

    position_m: Three
    yaw_rad: Number
    velocity_m_s: Three
    on_floor: bool
    outside: bool
    """Outside the flight volume."""
    touchdown_speed_m_s: Seconds = 0.0
    """Of the last touchdown."""
    touchdowns: Count = 0
    radio: tuple[tuple[Clock, ...], ...] = ()
    """Serial frames the module accepted since the last message: arrival [monotonic s], pulse widths [us]."""
    light: Colour | None = None
    """Red, green and blue that were requested of its LEDs, 0 to 255."""


class LaboratoryState(Message, frozen=True, kw_only=True):
    """True state of the simulated laboratory, for measurement only; no controller reads it."""

    MAX_BYTES: ClassVar[int] = 65_000

    frame: Count
    sent_s: Clock
    """Monotonic clock when the Tracker emulator sent this frame."""
    vehicles: dict[Name, LaboratoryVehicle]
    faults: tuple[Text, ...] = ()
    """Requested faults that last now."""
    refused_faults: tuple[Text, ...] = ()
    """Faults of a scenario that could not begin when their time came: the newest reasons."""


class LauncherStatus(Message, frozen=True, kw_only=True):
    """Processes of the launcher of a host."""

    running: tuple[Name, ...]
    """Vehicles whose agents are to run here; they are restarted when they die."""
    absent: tuple[Name, ...]
    """Vehicles whose agents run here by the fleet file, and do not at present."""
    restarts: dict[Text, Count] = field(default_factory=dict)
    """Restarts of each process."""
    spare_ready: bool = False
    """A warm process waits to replace an agent."""
    watchdog: bool = False
    """Processes without progress are ended and restarted."""
    hung: dict[Text, Count] = field(default_factory=dict)
    """How often each process was ended for lack of progress; also counted among its restarts."""
    longest_silence_s: dict[Text, Seconds] = field(default_factory=dict)
    """Longest time without progress of each process that runs."""
    forgiven: dict[Text, Count] = field(default_factory=dict)
    """How often a process was silent for longer than its limit and did not hang, by reason."""
    stalled_s: Seconds = 0.0
    """For how long the launcher has not checked its processes: those that die or hang are not replaced."""
    flies: tuple[Count, ...] = ()
    """Estimated numbers of vehicles like its own that this computer flies with every control period computed,
    with one of two, and so on; the last one is the most that it flies at all. Empty if that is not known."""
    measuring: bool = False
    """That estimate is still being measured and may be too low: take-offs should wait."""

    @property
    def control_every(self) -> int:
        """One of so many control periods is to be computed, so that this computer flies all that run here."""
        agents = len(self.running)
        fitting = (every for every, flown in enumerate(self.flies, 1) if agents <= flown)
        return next(fitting, max(1, len(self.flies)))

    @property
    def crowded(self) -> bool:
        """Whether more agents run here than this computer flies at all."""
        return bool(self.flies) and len(self.running) > self.flies[-1]


RouterId = Annotated[str, Meta(pattern="^[0-9a-f]{1,32}$")]
"""Zenoh's identity of a router process; a new one after every start."""


class Echo(Struct, frozen=True, kw_only=True):
    """The newest beat from a host."""

    router: RouterId
    sent_s: Clock
    """`sent_s` of the beat, on the monotonic clock of its sender."""
    held_s: Seconds
    """Time since its arrival."""


class Beat(Message, frozen=True, kw_only=True):
    """What routers send each other all the time, with the newest beats that they received."""

    router: RouterId
    sent_s: Clock
    """Monotonic clock of its host; meaningless on other hosts."""
    time_of_day_s: Clock
    """Time of the same moment since 1970 by the clock of its host."""
    echoes: dict[Name, Echo]
    """Newest beat from each other host."""


class LinkState(Struct, frozen=True, kw_only=True):
    """The link to one other host."""

    linked: bool
    """Beats arrive in both directions."""
    redials: Count
    """How often the link was closed because a direction was silent."""
    late: Count
    """Beats that arrived more than 0.1 s later than the fastest ones: the link hung."""
    round_trip_s: Seconds | None = None
    """Shortest of the last few seconds."""
    clock_offset_s: Clock | None = None
    """Time of day of the other host minus that of this one; wrong by at most half the round trip."""
    monotonic_offset_s: Clock | None = None
    """The same of the monotonic clocks, to subtract times of two hosts."""


class RouterStatus(Message, frozen=True, kw_only=True):
    """Links of a router to those of the other hosts of the fleet file."""

    links: dict[Name, LinkState]
