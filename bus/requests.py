"""Requests to running processes and their replies, in one table: verb, server, types of request and reply."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

from msgspec import Meta, Struct, field

from rcopterx.bus.intent import Intent
from rcopterx.bus.keys import SIMULATOR_UNIT
from rcopterx.bus.message import (
    Colour,
    Count,
    Finite,
    FloatArray,
    InvalidMessageError,
    Message,
    Name,
    Parameters,
    Parts,
    Seconds,
    Settings,
    Text,
    Whole,
)
from rcopterx.bus.messages import KNOT_COLUMNS, MAX_KNOTS, LeaderLink, SetPoint, ZoneSet

MAX_PATH_S: Final = 600.0
REST_TOLERANCE: Final = 1e-6
"""Computed trajectories seldom end with exact zeros."""

OPERATOR: Final = "operator"
ANYBODY: Final = "anybody"
EXTERNAL: Final = "external controller"
MAX_FAULTS: Final = 200
"""In one request."""
MAX_FAULT_FIELDS: Final = 12
MAX_LINE: Final = 2000
MAX_LINES: Final = 200
"""In one answer."""
LogName = Annotated[str, Meta(max_length=80)]
LogPositions = Annotated[dict[LogName, Count], Meta(max_length=256)]
"""Number of bytes of each log that are known."""
Amplitude = Annotated[float, Meta(ge=0, le=0.5)]
FieldName = Annotated[str, Meta(max_length=40)]
FaultField = bool | Whole | Finite | Text | tuple[Finite | tuple[Finite, ...], ...] | None


class Request(Message, frozen=True, kw_only=True):
    """Base class of all requests."""

    source: Name = "operator"


class Reply(Message, frozen=True, kw_only=True):
    """Base class of all replies."""

    accepted: bool
    reason: Text = ""
    """Why the request was refused, or what will happen."""


class Arm(Request, frozen=True, kw_only=True):
    """Let commands reach the transmitter."""


class Disarm(Request, frozen=True, kw_only=True):
    """Throttle low; commands are ignored until armed again."""


class KillVehicle(Request, frozen=True, kw_only=True):
    """Cut the motors now, latching."""

    cause: Text = "operator"


class ResetKill(Request, frozen=True, kw_only=True):
    """Leave KILLED for DISARMED."""


class SetLight(Request, frozen=True, kw_only=True):
    """Show a colour on the lights of the vehicle; refused by radios that reach none."""

    colour: Colour
    """Red, green, blue."""


class TakeOff(Request, frozen=True, kw_only=True):
    """Climb to a height above the place where the vehicle stands."""

    height_m: Annotated[float, Meta(gt=0.1, le=5)] = 1.0


class Land(Request, frozen=True, kw_only=True):
    """Descend where the vehicle is and switch the rotor off on the floor."""


class GoTo(Request, frozen=True, kw_only=True):
    """New set point of a leader."""

    set_point: SetPoint
    """Its heading is meant the nearest way round."""
    turns: Annotated[int, Meta(ge=-20, le=20)] = 0
    """Whole turns in addition, counter-clockwise from above."""


class Fly(Request, frozen=True, kw_only=True):
    """Fly a trajectory, after a smooth way to its beginning; it ends at rest."""

    MAX_BYTES: ClassVar[int] = 131072

    knots: FloatArray
    """Shape (n, 13), n from 2 to 600: time [s] from 0 on, x, y, z [m], yaw [rad], their rates and their
    accelerations, inertial frame; quintic polynomials in between. The first and the last knot are at rest."""

    def check(self) -> None:
        """See `Message.check`."""
        import numpy as np

        self.knots.check("knots", KNOT_COLUMNS, MAX_KNOTS, 2)
        times = self.knots.to_numpy()[:, 0]
        if times[0] != 0.0 or not (np.diff(times) > 0).all() or times[-1] > MAX_PATH_S:
            raise InvalidMessageError(f"knots: times must increase from 0 on, to at most {MAX_PATH_S:g} s")
        if np.abs(self.knots.to_numpy()[[0, -1], 5:]).max() > REST_TOLERANCE:
            raise InvalidMessageError("knots: the first and the last must be at rest")


class Follow(Request, frozen=True, kw_only=True):
    """Follow other vehicles' plans, or change the offsets to the present leaders."""

    following: Annotated[tuple[LeaderLink, ...], Meta(min_length=1, max_length=8)]
    transition_s: Annotated[float, Meta(ge=0, le=60)] | None = None
    """Time over which the offset moves to the new one; absent: at a moderate speed."""


class Lead(Request, frozen=True, kw_only=True):
    """Follow no leader: hold the present place."""


class Tune(Request, frozen=True, kw_only=True):
    """Change controller, estimator, their settings or the model; answered when the change is in effect."""

    controller: Name | None = None
    controller_settings: Settings = {}  # noqa: RUF012 - msgspec copies it
    """Weights, limits, horizon and other settings, added to the present ones."""
    estimator: Name | None = None
    estimator_settings: Settings = {}  # noqa: RUF012 - msgspec copies it
    model: Parameters = {}  # noqa: RUF012 - msgspec copies it
    """Identified parameters of the model; controller and estimator are built for it."""
    learned: Parts = ()
    """Parts of the model that were learned in ordinary flight; empty for a model from elsewhere."""


class Excite(Request, frozen=True, kw_only=True):
    """Add a multisine to the sticks of a flying vehicle without leaders, to identify it."""

    duration_s: Annotated[float, Meta(ge=0, le=300)]
    """0 ends the present excitation."""
    amplitude: tuple[Amplitude, Amplitude, Amplitude, Amplitude] = (0.0, 0.0, 0.0, 0.0)
    """Root mean square on pitch, roll, thrust and yaw."""
    reach_m: Annotated[float, Meta(gt=0, le=5)] = 0.3
    """It ends early when the vehicle is further than this from its set point on any axis."""
    comb: Annotated[int, Meta(ge=0, le=63)] = 0
    """Vehicles with different combs are excited at different frequencies."""


class TakeControl(Request, frozen=True, kw_only=True):
    """Let `source`, a program outside the agent, fly the vehicle; tasks begin at once."""

    patience_s: Annotated[float, Meta(ge=0.02, le=0.3)] = 0.1
    """Silence after which the vehicle's own controller takes over again."""


class ReleaseControl(Request, frozen=True, kw_only=True):
    """Return a vehicle that `source` flies to its own controller."""


class PrepareLeaders(Request, frozen=True, kw_only=True):
    """Prepare other leaders, or none, that several vehicles adopt at one frame."""

    operation: Name
    """Names the change; the same for all vehicles that take part."""
    following: Annotated[tuple[LeaderLink, ...], Meta(max_length=8)] = ()
    """New leaders; empty for a vehicle that will lead."""
    set_point: SetPoint | None = None
    """Place of a vehicle that will lead; absent for one that will follow."""


class CommitLeaders(Request, frozen=True, kw_only=True):
    """Adopt the prepared leaders at a future frame."""

    operation: Name
    epoch: Count
    frame: Count
    """First frame under the new leaders, on the clock of the poses."""


class Suspend(Request, frozen=True, kw_only=True):
    """Leave the present path at a future frame, and come to rest on it; other requests discard its rest."""

    epoch: Count
    frame: Count
    """On the clock of the poses, the same for all vehicles."""


class Resume(Suspend, frozen=True, kw_only=True):
    """Go on with the suspended path at a future frame."""


class SetZones(Request, frozen=True, kw_only=True):
    """Keep out of these zones from now on; a way that they bar is suspended."""

    zones: ZoneSet
    """Its revision is one more than the newest of any vehicle."""


class WithdrawLeaders(Request, frozen=True, kw_only=True):
    """Discard the prepared leaders, unless they have been adopted."""

    operation: Name


class StartVehicle(Request, frozen=True, kw_only=True):
    """Start the agent of a vehicle of the fleet file on this host and keep it running."""

    vehicle: Name


class StopVehicle(Request, frozen=True, kw_only=True):
    """End the agent of a vehicle on the floor."""

    vehicle: Name


class TakeVehicle(Request, frozen=True, kw_only=True):
    """Start a vehicle's agent on this host; it replaces the one elsewhere once it is warm."""

    vehicle: Name


class StartHost(Request, frozen=True, kw_only=True):
    """Start the processes of the fleet file on a host whose daemon runs."""

    without: tuple[Name, ...] = ()
    """Vehicles that do not take part at first."""


class StopHost(Request, frozen=True, kw_only=True):
    """End the processes of a host, except router and daemon; refused while vehicles are in the air."""


class LoggedLine(Struct, frozen=True):
    """A line of the log of a process."""

    time: Annotated[str, Meta(max_length=40)]
    """UTC, as it was written; empty if it is on a line that was sent before."""
    process: LogName
    text: Annotated[str, Meta(max_length=MAX_LINE)]


class ReadLogs(Request, frozen=True, kw_only=True):
    """Read the logs of the processes of a host."""

    names: Annotated[tuple[LogName, ...], Meta(max_length=64)] = ()
    """Processes or vehicles; none for all."""
    positions: LogPositions = field(default_factory=dict)
    """Of the previous answer; none to begin at the beginning."""


class ReadLogsReply(Reply, frozen=True, kw_only=True):
    """Lines after those that were sent before, as many as fit."""

    MAX_BYTES: ClassVar[int] = 65_000

    lines: Annotated[tuple[LoggedLine, ...], Meta(max_length=MAX_LINES)] = ()
    positions: LogPositions = field(default_factory=dict)
    """Where to continue, by file."""
    more: bool = False
    """There are further lines already."""


class Recall(Request, frozen=True, kw_only=True):
    """Return the last intent of a vehicle's agent; sent by an agent that starts."""

    vehicle: Name


class RecallReply(Reply, frozen=True, kw_only=True):
    """Last intent of the previous agent process."""

    intent: Intent | None = None
    age_s: Seconds = 0.0
    """Time since it was received."""
    quick_deaths: Count = 0
    """How often in a row the process has died shortly after its start."""


class InjectedFault(Struct, frozen=True, forbid_unknown_fields=True):
    """One fault of the simulated laboratory, and when it begins."""

    at_s: Annotated[float, Meta(ge=0, le=86_400)]
    """Counted from the arrival of the request."""
    fault: Annotated[dict[FieldName, FaultField], Meta(max_length=MAX_FAULT_FIELDS)]
    """Its `kind` and its fields; docs/motion_capture.md lists them; the simulator refuses others."""


class Identify(Request, frozen=True, kw_only=True):
    """Return which fleet is up here; sent before anything else, so that commands reach the right fleet."""


class IdentifyReply(Reply, frozen=True, kw_only=True):
    """The fleet of a router."""

    fleet: Name
    host: Name
    digest: Text
    """Digest of the fleet file; two programs with the same one use the same fleet file."""
    vehicles: tuple[Name, ...] = ()
    version: Text = ""
    """Of the software on this host."""


class Inject(Request, frozen=True, kw_only=True):
    """Inject faults into the simulated laboratory, now or later: its Tracker or its radio modules."""

    faults: Annotated[tuple[InjectedFault, ...], Meta(min_length=1, max_length=MAX_FAULTS)]
    """All of them, or none if one is refused."""


@dataclass(frozen=True)
class Verb:
    """One row of the table: who serves the verb, who may send it, and the types that travel."""

    name: str
    server: str
    request: type[Request]
    reply: type[Reply] = Reply
    asker: str = OPERATOR
    """Role that may send it; `ANYBODY` for every client."""
    unit: str = "vehicle"
    """Receiver, as in the table of channels: `vehicle`, `host`, or a fixed unit."""
    recorded: bool = True
    """Whether flight logs have requests and answers."""


def _verbs(
    server: str, asker: str = OPERATOR, unit: str = "vehicle", **kinds: type[Request]
) -> dict[str, Verb]:
    """Return rows of verbs that have `Reply` for a reply."""
    return {name: Verb(name, server, kind, asker=asker, unit=unit) for name, kind in kinds.items()}


VERBS: Final = {
    **_verbs("transmitter_gateway", arm=Arm, disarm=Disarm, kill=KillVehicle, reset=ResetKill),
    **_verbs("transmitter_gateway", set_light=SetLight),
    **_verbs("agent", take_off=TakeOff, land=Land, go_to=GoTo, fly=Fly, follow=Follow, lead=Lead),
    **_verbs("agent", tune=Tune, excite=Excite, set_zones=SetZones),
    **_verbs("agent", EXTERNAL, take_control=TakeControl, release_control=ReleaseControl),
    **_verbs("agent", prepare_leaders=PrepareLeaders, commit_leaders=CommitLeaders),
    **_verbs("agent", withdraw_leaders=WithdrawLeaders, suspend=Suspend, resume=Resume),
    **_verbs("launcher", unit="host", start_vehicle=StartVehicle, stop_vehicle=StopVehicle),
    **_verbs("launcher", unit="host", take_vehicle=TakeVehicle, start_host=StartHost, stop_host=StopHost),
    "read_logs": Verb("read_logs", "launcher", ReadLogs, ReadLogsReply, ANYBODY, "host", recorded=False),
    "recall": Verb("recall", "launcher", Recall, RecallReply, "agent", "host"),
    "identify": Verb("identify", "router", Identify, IdentifyReply, ANYBODY, "host"),
    **_verbs("simulator", unit=SIMULATOR_UNIT, inject=Inject),
}
"""Every verb by name. The key is `rcopterx/<fleet>/<vehicle>/request/<verb>`."""


def verb_of(kind: type[Request]) -> Verb:
    """Return the row of a type of requests; raises `InvalidMessageError` for an unknown type."""
    for verb in VERBS.values():
        if verb.request is kind:
            return verb
    raise InvalidMessageError(f"{kind.__name__} is not a request of the table")
