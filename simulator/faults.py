"""Faults of the simulated laboratory (docs/motion_capture.md), messages with a `kind`, until `recover`."""

import heapq
import itertools
import math
from collections.abc import Iterable, Iterator
from typing import Annotated, Final, Generic, NamedTuple, TypeVar

from msgspec import Meta, Struct, ValidationError, convert
from msgspec.structs import asdict

from rcopterx.bus.message import Four, Place, Seconds, Stick, Three
from rcopterx.bus.requests import InjectedFault

RadioCondition = Annotated[str, Meta(pattern="^(unplugged|adapter|off|refusing)$")]
StickName = Annotated[str, Meta(pattern="^(pitch|roll|thrust|yaw)$")]
Subject = Annotated[str, Meta(min_length=1, max_length=400)]
MAX_FRAME_ID: Final = 0xFFFFFFFE


class FaultError(ValueError):
    """A fault that cannot be carried out; the text names the allowed values."""


class FaultRequest(Struct, frozen=True, tag_field="kind", forbid_unknown_fields=True):
    """Base of all faults."""


class LastingFault(FaultRequest, frozen=True, kw_only=True):
    """Base of the faults that stay for a while; the same fault again replaces the first."""

    duration_s: Seconds | None = None
    """How long it lasts; without it until `recover`."""

    @property
    def slot(self) -> tuple[object, ...]:
        """Key of a fault: a second one with the same key replaces the first."""
        return type(self), getattr(self, "subject", getattr(self, "vehicle", None))


class SubjectFault(LastingFault, frozen=True):
    """Base of the faults of one subject."""

    subject: Subject


class Close(FaultRequest, frozen=True, tag="close"):
    """Close every connection to the Tracker in order."""


class Reset(FaultRequest, frozen=True, tag="reset"):
    """Reset every connection to the Tracker (TCP RST)."""


class WrongMagic(FaultRequest, frozen=True, tag="wrong_magic"):
    """Send one packet that begins with wrong bytes to every client."""


class ResetFrameId(FaultRequest, frozen=True, tag="reset_frame_id"):
    """Continue the frame number from `frame`, as after a restart of the capture."""

    frame: Annotated[int, Meta(ge=0, le=MAX_FRAME_ID)] = 0


class Burst(FaultRequest, frozen=True, tag="burst"):
    """Hold back this many frames and send them together with the last one."""

    frames: Annotated[int, Meta(ge=1, le=1000)] = 10


class Recover(FaultRequest, frozen=True, tag="recover"):
    """End all lasting faults; the frame number keeps its offset."""


class Silence(LastingFault, frozen=True, tag="silence"):
    """Send nothing at all, connections stay open."""


class Freeze(LastingFault, frozen=True, tag="freeze"):
    """Send the same frame again and again, number and all."""


class EmptyPackets(LastingFault, frozen=True, tag="empty_packets"):
    """Send empty packets in place of frames."""


class IgnorePings(LastingFault, frozen=True, tag="ignore_pings"):
    """Leave pings unanswered."""


class Dribble(LastingFault, frozen=True, tag="dribble"):
    """Send a few bytes at a time."""

    chunk_bytes: Annotated[int, Meta(ge=1)] = 7
    interval_s: Annotated[float, Meta(ge=0, le=1)] = 0.0002


class Delay(LastingFault, frozen=True, tag="delay"):
    """Send every packet late."""

    delay_s: Annotated[float, Meta(ge=0, le=10)] = 0.05


class UnknownObject(LastingFault, frozen=True, tag="unknown_object"):
    """Put an object of an unknown type into every frame packet."""

    object_type: Annotated[int, Meta(ge=1, le=0xFFFFFFFF)] = 64_123
    size_bytes: Annotated[int, Meta(ge=0, le=65_536)] = 40


class YUp(LastingFault, frozen=True, tag="y_up"):
    """Send Y-up data, and report it in ApplicationInfo; a `tracker1` cannot report it."""


class Millimetres(LastingFault, frozen=True, tag="millimetres"):
    """Send positions in millimetres, where the protocol has metres."""


class Occlude(SubjectFault, frozen=True, tag="occlude"):
    """List a subject without a pose."""


class RemoveSubject(SubjectFault, frozen=True, tag="remove_subject"):
    """Take a subject off the list."""


class AddSubject(SubjectFault, frozen=True, tag="add_subject"):
    """List one more subject, which stands still, or moves along a way, linearly between its places."""

    position_m: Place = (0.0, 0.0, 0.0)
    way: Annotated[tuple[Four, ...], Meta(max_length=2000)] = ()
    """Further places: seconds from the beginning on, x, y, z."""


class FreezePose(SubjectFault, frozen=True, tag="freeze_pose"):
    """Show a subject where it was when the fault began, while the frames go on."""


class StandIn(SubjectFault, frozen=True, tag="stand_in"):
    """Show another body as a subject, one that stands where the subject was when the fault began."""

    deviation_m: Annotated[float, Meta(ge=0, le=1)] = 0.0003
    """Measurement noise of its position on each axis, as a standard deviation."""


class DisplacePose(SubjectFault, frozen=True, tag="displace_pose"):
    """Show a subject beside where it is: at once, and ever further with a velocity."""

    offset_m: Place = (0.0, 0.0, 0.0)
    velocity_m_s: Three = (0.0, 0.0, 0.0)


class TurnPose(SubjectFault, frozen=True, tag="turn_pose"):
    """Show a subject turned about its vertical axis: its object was created with the nose elsewhere."""

    yaw_rad: Annotated[float, Meta(ge=-math.pi, le=math.pi)] = math.pi


class AddNoise(LastingFault, frozen=True, tag="add_noise"):
    """Add noise to all positions: white, from frame to frame."""

    deviation_m: Annotated[float, Meta(ge=0, le=1)] = 0.002  # standard deviation on each axis


class SkipFrames(LastingFault, frozen=True, tag="skip_frames"):
    """Send one of so many frames only, as a Tracker that has lowered its rate."""

    one_of: Annotated[int, Meta(ge=2, le=100)] = 2


class SetQuality(SubjectFault, frozen=True, tag="set_quality"):
    """Report this quality for a subject."""

    quality: Annotated[float, Meta(ge=0, le=1)]


class RenameRootSegment(SubjectFault, frozen=True, tag="rename_root_segment"):
    """Give a subject's root segment another name."""

    segment: Annotated[str, Meta(max_length=400)]


class SwapSubjects(SubjectFault, frozen=True, tag="swap_subjects"):
    """Take two subjects for one another."""

    other: Subject


class VehicleFault(LastingFault, frozen=True):
    """Base of the faults of one vehicle."""

    vehicle: Annotated[str, Meta(max_length=400)]


class BreakRadio(VehicleFault, frozen=True, tag="break_radio"):
    """Break a vehicle's radio: cable pulled, adapter gone, no power, or a firmware without DSM2."""

    condition: RadioCondition = "unplugged"


class BreakVehicle(VehicleFault, frozen=True, tag="break_vehicle"):
    """Break a vehicle itself: a weak rotor, sticks that act wrongly or late, or off their trim."""

    thrust_factor: Annotated[float, Meta(ge=0, le=1)] = 1.0  # share of the thrust that is left; 0 for no lift
    dead: StickName | None = None  # stick without effect
    reversed: StickName | None = None  # stick that acts the wrong way round
    exchanged: bool = False  # whether the pitch stick rolls and the roll stick pitches
    stuck: StickName | None = None  # stick that stays where it is
    cyclic_factor: Annotated[float, Meta(ge=0, le=10)] = 1.0
    """Effect of the pitch and roll sticks, relative to that of the sound vehicle."""
    attitude_gain: Annotated[float, Meta(ge=0, le=2)] = 1.0
    """Torque that the attitude loop of its firmware obtains, relative to that of the sound vehicle."""
    delay_s: Annotated[float, Meta(ge=0, le=1)] = 0.0  # by how much later the sticks act
    trim: tuple[Stick, Stick, Stick, Stick] = (0.0, 0.0, 0.0, 0.0)
    """Offsets of the sticks: pitch, roll, thrust, yaw."""


TrackerFault = (
    Close | Reset | WrongMagic | ResetFrameId | Burst | Recover | Silence | Freeze | EmptyPackets
    | IgnorePings | Dribble | Delay | UnknownObject | YUp | Millimetres | Occlude | RemoveSubject | AddSubject
    | FreezePose | StandIn | DisplacePose | TurnPose | AddNoise | SkipFrames | SetQuality | RenameRootSegment
    | SwapSubjects
)  # fmt: skip
"""Faults of the emulated Tracker."""

Fault = TrackerFault | BreakRadio | BreakVehicle  # faults of the simulated laboratory


class TimedFault(Struct, frozen=True, forbid_unknown_fields=True):
    """A line of a scenario."""

    at_s: Annotated[float, Meta(ge=0, le=86_400)]  # when it begins, counted from the arrival of the request
    fault: Fault


def timed_faults(lines: Iterable[InjectedFault]) -> tuple[TimedFault, ...]:
    """Faults of a request; `FaultError` for an unknown kind or field, or a value of the wrong type."""
    table: list[TimedFault] = []
    for line in lines:
        kind = line.fault.get("kind")
        try:
            table.append(TimedFault(line.at_s, convert(line.fault, Fault)))
        except ValidationError as error:
            raise FaultError(f"{kind}: {error}") from None
    return tuple(table)


def fault_text(fault: FaultRequest) -> str:
    """Return the kind of a fault and its fields, for people."""
    fields = ", ".join(f"{name} {value}" for name, value in asdict(fault).items() if value is not None)
    kind = str(fault.__struct_config__.tag)
    return f"{kind} ({fields})" if fields else kind


L = TypeVar("L")
F = TypeVar("F", bound=LastingFault)


class Lasting(NamedTuple, Generic[F]):
    """A fault that lasts; without an end of its own until `Recover`."""

    fault: F
    started_s: float
    ends_s: float


class FaultTable(Generic[L, F]):
    """Faults L that begin later, and those F of them that have begun and last, by their slots."""

    def __init__(self) -> None:
        self._lines: list[tuple[float, int, L]] = []
        self._order = itertools.count()
        self.lasting: dict[tuple[object, ...], Lasting[F]] = {}

    @property
    def active(self) -> tuple[F, ...]:
        """Faults that last now."""
        return tuple(entry.fault for entry in self.lasting.values())

    def add(self, at_s: float, fault: L) -> None:
        """Add a fault that begins at a time."""
        heapq.heappush(self._lines, (at_s, next(self._order), fault))

    def due(self, now_s: float) -> Iterator[tuple[float, L]]:
        """Remove the faults that are due, and yield their times and them."""
        while self._lines and self._lines[0][0] <= now_s:
            at_s, _, fault = heapq.heappop(self._lines)
            yield at_s, fault

    def begin(self, fault: F, at_s: float) -> None:
        """Note that a fault lasts from a time on."""
        ends_s = math.inf if fault.duration_s is None else at_s + fault.duration_s
        self.lasting[fault.slot] = Lasting(fault, at_s, ends_s)

    def end(self, by_s: float = math.inf) -> list[F]:
        """Remove and return the lasting faults whose time is over, by default all."""
        over = [slot for slot, entry in self.lasting.items() if entry.ends_s <= by_s]
        return [self.lasting.pop(slot).fault for slot in over]

    def next_change_s(self) -> float:
        """Return when a fault begins or ends next, infinite for never."""
        times = [entry.ends_s for entry in self.lasting.values()] + [line[0] for line in self._lines[:1]]
        return min(times, default=math.inf)
