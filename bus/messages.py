"""The messages on the bus: typed, in SI units, validated on arrival.

Every message carries `schema_version`. Fields are only ever appended, with defaults, so that programs of
different versions understand each other. `check` holds what types cannot express.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from rcopterx.bus.message import (
    MAX_MAGNITUDE,
    Amount,
    Clock,
    Count,
    FloatArray,
    Four,
    InvalidMessageError,
    Message,
    Name,
    Number,
    Parameters,
    Parts,
    Period,
    Place,
    Seconds,
    Settings,
    Stick,
    Text,
    Three,
    Weight,
)
from rcopterx.bus.trajectory_array import TrajectoryArray


class CommandTiming(Struct, frozen=True, kw_only=True):
    """Times of one command; each is on the monotonic clock of the host named beside it.

    Differences between hosts need the offset of their clocks, which routers measure
    (`rcopterx.bus.host_messages.LinkState.monotonic_offset_s`).
    """

    latency_s: Seconds
    """From capture to the Vicon gateway, as far as the Tracker and the network report it."""
    gateway_host: Name
    received_s: Clock
    """Arrival of the frame at the Vicon gateway, on the clock of `gateway_host`."""
    agent_host: Name
    arrived_s: Clock
    """Arrival of the pose at the agent, on the clock of `agent_host`."""
    began_s: Clock
    """Start of the controller: the estimate was ready, and plans of leaders had arrived or were overdue."""
    ready_s: Clock
    """End of the controller."""


MAX_STAGES = 200
MAX_NEXT_INPUTS = 90
"""Enough for the time that planned inputs bridge, at the shortest control period."""
MAX_KNOTS = 600
KNOT_COLUMNS = 13
MAX_REMARKS = 8
MAX_RATE_HZ = 2000.0
"""Of the motion capture."""

ArbiterState = Annotated[str, Meta(pattern="^(disarmed|armed|hold|land|descend|cut|killed)$")]


class Pose(Message, frozen=True, kw_only=True):
    """One frame of the motion capture for one vehicle, Z up, inertial frame."""

    epoch: Count
    """Identifies an uninterrupted stream of frames [ms of wall clock at its start]."""
    frame: Count
    """Raw frame number of the Tracker: the fleet's clock."""
    period_s: Annotated[float, Meta(ge=1 / MAX_RATE_HZ, le=1)]
    """Time between frames."""
    latency_s: Seconds
    """From capture to arrival at the gateway, as far as the Tracker and the network report it."""
    received_s: Clock
    """Monotonic clock of the gateway's host at arrival; meaningless on other hosts."""
    occluded: bool
    """The Tracker does not see the vehicle in this frame: position and orientation are absent."""
    position_m: Place | None = None
    quaternion_xyzw: Four | None = None
    quality: Annotated[float, Meta(ge=0, le=1)] | None = None
    """0 (bad) to 1 (good); absent where the Tracker does not report it."""
    host: Name | None = None
    """Host of the gateway, whose monotonic clock `received_s` is."""

    def check(self) -> None:
        """See `Message.check`."""
        if self.occluded:
            if self.position_m is not None or self.quaternion_xyzw is not None:
                raise InvalidMessageError("position_m: an occluded pose must not carry a position")
            return
        if self.position_m is None or self.quaternion_xyzw is None:
            raise InvalidMessageError("position_m: missing in a pose that is not occluded")
        x, y, z, w = self.quaternion_xyzw
        norm = x * x + y * y + z * z + w * w
        if abs(norm - 1) > 0.01:
            raise InvalidMessageError(f"quaternion_xyzw: squared norm {norm:.3f}, must be 1")


class SetPoint(Struct, frozen=True, kw_only=True):
    """Target position and heading, inertial frame."""

    position_m: Place
    yaw_rad: Number


class LeaderLink(Struct, frozen=True, kw_only=True):
    """A leader and the offset to it."""

    leader: Name
    """Vehicle to follow."""
    offset_m: Place = (0.0, 0.0, 0.0)
    """Position relative to the leader: x, y, z."""
    yaw_offset_rad: Number = 0.0
    """Heading relative to the leader's."""
    frame: Annotated[str, Meta(pattern="^(inertial|heading)$")] = "inertial"
    """Whether the offset is fixed in the room or turns with the leader's heading."""
    weight: Weight = 1.0
    """Share of this leader among several; only ratios count."""


class Zone(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A keep-out zone: no vehicle is sent into it, through it, or down onto it."""

    min_m: Place
    """Lowest x, y, z."""
    max_m: Place
    """Highest x, y, z."""
    shape: Literal["box", "cylinder"] = "box"
    """`cylinder` is the upright one inside these corners, which are those of a square."""
    margin_m: Annotated[float, Meta(ge=0, le=5)] = 0.2
    """Distance that references keep from it: half a vehicle, and how far it may be from its reference."""


class ZoneSet(Struct, frozen=True, kw_only=True):
    """All keep-out zones of a fleet as they were changed in flight; of two sets the later one counts."""

    revision: Count
    """Number of changes since the fleet file."""
    zones: Annotated[dict[Name, Zone], Meta(max_length=32)]
    """By name."""


class Plan(Message, frozen=True, kw_only=True):
    """Predicted trajectory of a vehicle; its followers subscribe to it."""

    epoch: Count
    frame: Count
    """Epoch and frame of the pose it was computed from."""
    source: Name
    ancestors: Annotated[tuple[Name, ...], Meta(max_length=64)]
    """Leaders of the source, nearest first; none of them may follow the source."""
    period_s: Period
    """Time between stages."""
    start_s: Annotated[float, Meta(ge=-1, le=1)]
    """Time of the first stage after the capture of `frame`: the delay that the source compensated."""
    airborne: bool = True
    """False while the source stands on the floor: followers then keep their own place."""
    trajectory: TrajectoryArray
    """Stages times (x y z [m], yaw [rad], velocity [m/s], yaw rate [rad/s], acceleration [m/s^2], yaw
    acceleration [rad/s^2]), inertial frame."""
    reference: Four | None = None
    """Reference of the first stage: x, y, z [m], yaw [rad]; absent on the floor."""
    following: tuple[LeaderLink, ...] = ()
    """Leaders with the offsets of this moment, also while an offset moves to a new value."""
    followable: bool = True
    """False unless the source flies freely: while it takes off or lands its followers keep their place."""
    nominal: TrajectoryArray | None = None
    """Stages at which the source would be if no vehicle above it were disturbed; followers copy a part only
    of the deviation from it. Absent on the floor and where it is not known."""
    margins_m: Annotated[tuple[Amount, ...], Meta(max_length=MAX_STAGES)] = ()
    """How much farther others keep from a stage, for a subject that is no vehicle: its future is a guess."""

    def check(self) -> None:
        """See `Message.check`."""
        self.trajectory.check("trajectory", MAX_STAGES, min_stages=2)
        if self.nominal is not None:
            stages = self.trajectory.stages
            self.nominal.check("nominal", stages, min_stages=stages)


class Command(Message, frozen=True, kw_only=True):
    """Stick command of a vehicle, with the inputs to use if the next command is late."""

    epoch: Count
    frame: Count
    """Epoch and frame of the pose it was computed from; an agent that bridges missing poses states the frame
    of the present, which it predicted."""
    lease: Count
    """Control lease of the agent; commands of an earlier lease than the present one are rejected."""
    sequence: Count
    """Strictly increasing within a lease."""
    input: Four
    """Pitch, roll, thrust, yaw; normalised sticks."""
    next_inputs: FloatArray
    """The following planned inputs, `period_s` apart, shape (k, 4)."""
    period_s: Period
    given_up: Text | None = None
    """Why the agent has given up the flight: the vehicle, which stands, has to be disarmed."""
    timing: CommandTiming | None = None
    """Absent where the frame was predicted, not seen."""

    def check(self) -> None:
        """See `Message.check`."""
        self.next_inputs.check("next_inputs", 4, MAX_NEXT_INPUTS)


class LeaseBid(Message, frozen=True, kw_only=True):
    """Request of an agent to the transmitter gateway for a control lease, repeated until it has one."""

    agent: Count
    """Identifies the process."""
    host: Name | None = None
    """Host of the agent."""
    take_over: bool = False
    """It is ready to replace the agent that commands, on request of an operator."""


class Lease(Message, frozen=True, kw_only=True):
    """Answer to a bid, and news that another agent commands."""

    agent: Count
    """Agent that it is about."""
    number: Count
    """Its lease; 0 while another agent commands."""
    commanding: Count
    """Lease whose commands count."""
    issued: Count
    """Newest lease of the vehicle."""


class Diagnostics(Struct, kw_only=True):
    """Condition of an agent, for people and recorders; no decision depends on it."""

    controller: Name
    estimator: Name
    controller_settings: Settings = {}
    """Settings that the fleet file or a request changed; all others have their defaults."""
    estimator_settings: Settings = {}
    horizon: Count
    effort_factor: Annotated[float, Meta(ge=1, le=MAX_MAGNITUDE)] = 1.0
    """Factor of the sticks' weights by which the guard against oscillation has lowered the bandwidth."""
    client: Text = ""
    """External program that flies the vehicle; empty while its own controller does."""
    plan_age_s: Seconds | None = None
    """Age of the leader's plan at the last step."""
    ticks: Count = 0
    missed_ticks: Count = 0
    """Control periods without a command although the vehicle was to be controlled."""
    solve_ms_p50: Seconds = 0.0
    solve_ms_p99: Seconds = 0.0
    solve_ms_max: Seconds = 0.0
    fallbacks: dict[str, Count] = {}
    """Steps that were not the optimum, other departures from the plan, events of the estimator; by kind."""
    rejected: dict[str, Count] = {}
    """Rejected messages by topic and reason."""
    avoiding_ticks: Count = 0
    """Control periods in which the plan avoided that of another vehicle."""
    closest_plan_m: Amount | None = None
    """Smallest predicted distance to a vehicle whose plan is known."""
    hover_thrust: Amount | None = None
    """Share of the largest thrust at which the vehicle hovers: it grows as the battery empties; in flight."""
    wind_m_s2: tuple[Number, Number] | None = None
    """Horizontal acceleration by wind and everything else outside the model, inertial frame; in flight."""
    position_deviation_m: tuple[Amount, Amount, Amount] | None = None
    """Standard deviations of the estimated position, inertial frame, if known; in flight."""
    realtime: bool = False
    """The process runs in a real-time scheduling class."""
    process: Count = 0
    """Process id."""
    remarks: Annotated[tuple[Text, ...], Meta(max_length=MAX_REMARKS)] = ()
    """Notes for people: what failed, and what replaces it."""
    model: Parameters = {}
    """Parameters of the model that a request changed; all others are those of the fleet file."""
    learned: Parts = ()
    """Parts of the model that were learned in ordinary flight."""
    learned_age_s: Seconds | None = None
    """Since when the vehicle flies with what it has learned; absent if that is nothing."""


class AgentStatus(Message, frozen=True, kw_only=True):
    """State of a vehicle: the part that others coordinate by, and diagnostics for people."""

    phase: Name
    epoch: Count
    frame: Count
    set_point: SetPoint
    following: tuple[LeaderLink, ...] = ()
    """Leaders now, with the offsets of this moment; empty without leaders."""
    assigned: tuple[LeaderLink, ...] = ()
    """Leaders by fleet file or request, with their final offsets."""
    following_mode: Name = "follow"
    """`follow`, and while the assigned leaders are lost `use_last_plan`, `hold`, `lead`, `follow_successor`
    or `land`."""
    position_m: Three | None = None
    velocity_m_s: Three | None = None
    yaw_rad: Number | None = None
    error_m: Amount | None = None
    """Distance from the reference when the newest command takes effect; absent on the floor."""
    path_left_s: Seconds = 0.0
    """Remaining time of the trajectory that the vehicle flies; 0 without one."""
    excitation_left_s: Seconds = 0.0
    """Remaining time of the excitation for an identification; 0 without one."""
    excitation: Text = ""
    """`under way`, `done`, or why the last excitation ended early; empty before the first."""
    diagnostics: Diagnostics
    pose_age_s: Seconds | None = None
    """Time since the newest pose of the vehicle arrived, without which it does not take off."""
    late_share: Seconds = 0.0
    """Share of the commands of the last second that were late or missing: too large for a take-off, and for
    more agents on the host."""
    host: Name | None = None
    """Host of the agent."""
    home_m: Three | None = None
    """Where the vehicle stood when it took off last; absent before."""
    zones: ZoneSet | None = None
    """Keep-out zones that replace those of the fleet file; absent until one is changed."""


class Battery(Struct, frozen=True, kw_only=True):
    """A vehicle's battery as its radio reports it."""

    voltage_v: Amount
    """Newest voltage of the whole battery [V]."""
    share: Annotated[float, Meta(ge=0, le=1)] | None = None
    """Place of the voltage between that at which the vehicle lands and that of a full battery, if given."""
    low: bool = False
    """Below the voltage that a take-off needs."""
    charged: bool = False
    """Full, on the floor."""
    left_s: tuple[Seconds, Seconds] | None = None
    """Shortest and longest remaining flight time, in flight; absent where it cannot be predicted."""


class TransmitterStatus(Message, frozen=True, kw_only=True):
    """State of one transmitter and of its arbiter."""

    state: ArbiterState
    reason: Text
    link: Name
    """State of the serial port."""
    module: Text
    """State of the radio module as it reports it."""
    ready: bool
    armed: bool | None = None
    """Whether the vehicle's firmware reports that it is armed; absent where it does not report it."""
    battery: Battery | None = None
    """Absent while its voltage is unknown."""
    lease: Count = 0
    """Control lease whose commands count; 0 before the first command."""
    command_age_s: Seconds | None = None
    """Time since the newest accepted command arrived; absent before the first."""
    pose_age_s: Seconds | None = None
    """Time since the newest pose of the vehicle arrived, seen or occluded; absent before the first."""
    bridging: bool = False
    counters: dict[str, Count] = field(default_factory=dict)
    rejected: dict[str, Count] = field(default_factory=dict)
    realtime: bool = False
    pose_problems: tuple[Text, ...] = ()
    """Why the pose of the vehicle, while it stands on the floor, is not plausible; arming is refused then."""


class Applied(Message, frozen=True, kw_only=True):
    """What was written to a radio module: one message per serial frame."""

    state: ArbiterState
    input: tuple[Stick, Stick, Stick, Stick]
    """Input after the arbiter, as calibrated to pulse widths."""
    pulse_width_us: Annotated[tuple[Number, ...], Meta(max_length=16)]
    epoch: Count
    frame: Count
    sequence: Count
    """Epoch, frame and sequence of the newest command when this frame was written."""
    fresh: bool
    """Written because this command arrived, not as a keep-alive."""
    command_arrived_s: Clock | None = None
    written_s: Clock = 0.0
    """Monotonic clocks of the gateway's host."""
    host: Name | None = None
    """Host of the gateway."""
    timing: CommandTiming | None = None
    """Of the command, where it is fresh."""
    lease: Count = 0
    """Control lease whose commands count; 0 before the first command."""


class Kill(Message, frozen=True, kw_only=True):
    """Cut the motors now and stay cut. Repeated at 10 Hz while active."""

    source: Name
    reason: Text
    vehicles: tuple[Name, ...] = ()
    """Empty for every vehicle."""
