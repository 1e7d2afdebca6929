"""What a fleet file may say: its tables as types, with defaults, units and limits.

A file without a `[simulator]` table flies hardware: that table, the Tracker's address and the serial ports
are the only difference.
"""

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from rcopterx.bus import channels
from rcopterx.bus.message import Four, Name, Three

Positive = Annotated[float, Meta(gt=0)]
Text = Annotated[str, Meta(min_length=1)]

DEFAULT_HOST = "main"
RESERVED_UNITS = (channels.TRACKER_UNIT, channels.SIMULATOR_UNIT, channels.FLEET_UNIT)
"""Units of the bus that are no vehicles."""
RESERVED_PROCESSES = ("router", "simulator", "tracker", "recorder", "spare")
"""Names of processes that are no transmitter gateways."""


class FleetError(ValueError):
    """The fleet file cannot be used; names the file, the field and what is allowed."""


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the fleet file."""


class VolumeConfig(Table, frozen=True, kw_only=True):
    """Flight volume in the inertial frame."""

    min_m: Three = (-1.2, -1.2, 0.0)
    """Lowest x, y, z; a volume may begin above the floor, which is at z = 0 then."""
    max_m: Three = (1.2, 1.2, 2.0)
    """Highest x, y, z. Set points outside are refused, vehicles outside are brought down."""


class TrackerConfig(Table, frozen=True, kw_only=True):
    """The motion capture."""

    host: Name = DEFAULT_HOST
    """Host that runs the gateway."""
    address: str = "127.0.0.1:801"
    """Address and port of the Tracker's data stream, or of the motion capture of another brand."""
    brand: str = "vicon"
    """`vicon` is read by our own client, the others (`vicon_sdk` too) by the library `motioncapture`."""
    rate_hz: Annotated[float, Meta(gt=0, le=2000)] | None = None
    """Capture rate of a motion capture that does not tell it."""
    latency_s: Annotated[float, Meta(ge=0, le=1)] | None = None
    """From capture to arrival, of a motion capture that does not tell it."""
    settings: dict[str, str] = field(default_factory=dict)
    """Further settings of the library, spelt as it spells them."""
    record_raw: Text | None = None
    """File to record the raw stream into; relative to where the gateway is started."""


class SimulatorConfig(Table, frozen=True, kw_only=True):
    """The fake laboratory. Leave this table out to fly hardware."""

    host: Name = DEFAULT_HOST
    """Host that runs the simulator and therefore all transmitter gateways."""
    rate_hz: Annotated[float, Meta(ge=20, le=400)] = 50.0
    """Frame rate of the simulated Tracker."""
    profile: Literal["tracker1", "tracker2", "tracker3"] = "tracker3"
    """Generation of the Tracker that is emulated."""
    seed: Annotated[int, Meta(ge=0)] = 0
    """The same seed draws the same vehicles, noise and wind."""
    conditions: str = "helicopter"
    """Name of a preset: `ideal`, `laboratory`, `helicopter` or `helicopters`."""
    condition_overrides: dict[str, Any] = {}
    """Single values that differ from the preset."""
    start: dict[Name, Four] = {}
    """Where vehicles stand at first: x, y, z [m], yaw [rad]. Default: their place in the formation."""


class HostConfig(Table, frozen=True, kw_only=True):
    """A computer that runs part of the fleet."""

    address: str = "127.0.0.1"
    """Where other hosts reach it."""
    router_port: Annotated[int, Meta(ge=1, le=65535)] = 7447
    """TCP port of the bus router."""
    steering: bool = True
    """Whether operators may steer through the router of this host; only fleets with certificates ask."""


class BusConfig(Table, frozen=True, kw_only=True):
    """How processes talk and how they are scheduled."""

    namespace: Name | None = None
    """Keeps fleets of tests apart; leave it out in a laboratory."""
    realtime_priority: Annotated[int, Meta(ge=0, le=90)] = 20
    """SCHED_FIFO priority where the operating system permits it; 0 for none."""


class SecurityConfig(Table, frozen=True, kw_only=True):
    """Who is let in from other computers, and what for."""

    certificates: Text | None = None
    """Directory of the certificates that `rcopterx certs` makes, on every host: an absolute path, or one that
    begins with `~`. Hosts and operators then show them to each other, and everything is encrypted."""
    insecure: bool = False
    """Hosts may be reachable over the network without certificates; whoever reaches them can steer."""
    operators: list[Name] = field(default_factory=lambda: ["lab"])
    """People and programs on other computers that may steer; each has a certificate."""
    watchers: list[Name] = field(default_factory=lambda: ["lab"])
    """People and programs on other computers that may only watch."""


class GatewayConfig(Table, frozen=True, kw_only=True):
    """A transmitter gateway process."""

    host: Name = DEFAULT_HOST
    """Host the radio modules are plugged into."""


class TransmitterConfig(Table, frozen=True, kw_only=True):
    """A vehicle's transmitter."""

    port: Text
    """Serial device; with a `[simulator]` a relative path is created in the fleet's run directory."""
    gateway: Name = "transmitters"
    """Gateway that serves it."""
    protocol: Literal["multi", "dsm2_serial", "dsmp", "ppm"] = "multi"
    """What the radio module speaks."""
    model_match: Annotated[int, Meta(ge=0, le=63)] = 0
    """Number that binds a receiver to this transmitter; every vehicle needs its own."""
    low_power: bool = False
    """Ask the radio for low power."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the protocol."""
    calibration: dict[str, Any] = field(default_factory=dict)
    """From normalised input to pulse width, by channel."""


class ControlConfig(Table, frozen=True, kw_only=True):
    """Controller and estimator of a vehicle."""

    controller: str = "cascade"
    """Name of a controller: of the package, or of one that was installed."""
    estimator: str = "extended_kalman"
    """Name of an estimator."""
    horizon: Annotated[int, Meta(ge=2, le=200)] = 50
    """Number of stages N."""
    period_s: Annotated[float, Meta(gt=0, le=0.2)] = 0.02
    """Control period; a whole multiple of the Tracker's frame period."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the controller: weights, constraints, options."""
    estimator_settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the estimator."""
    leader_wait_s: Annotated[float, Meta(ge=0, le=0.015)] = 0.002
    """How long after its own pose a follower waits for the leader's plan of the same frame, for each leader
    above it; at most half a control period."""


class LeaderConfig(Table, frozen=True, kw_only=True):
    """Whom a vehicle follows from the start."""

    leader: Name
    """Vehicle to follow."""
    offset_m: Three
    """Place beside the leader: x, y, z."""
    yaw_offset_rad: float = 0.0
    """Heading relative to the leader's."""
    frame: Literal["inertial", "heading"] = "inertial"
    """Whether the offset keeps its direction in the room or turns with the leader."""
    weight: Positive = 1.0
    """Share of this leader where there are several."""


class LeaderLostConfig(Table, frozen=True, kw_only=True):
    """What a follower does when its leaders are lost, after it has ridden out their last plans."""

    then: Literal["hold", "promote", "land"] = "hold"
    """Keep the place; follow a successor or become it; or land."""
    after_s: Annotated[float, Meta(ge=0.5, le=60)] = 2.0
    """How long leaders are waited for; until then the place is kept."""


class BatteryConfig(Table, frozen=True, kw_only=True):
    """When a vehicle's battery counts as empty, told by the thrust that it needs to hover."""

    warn_at_thrust: Annotated[float, Meta(gt=0, le=1)] = 0.8
    """Share of the largest thrust from which a warning is told."""
    land_at_thrust: Annotated[float, Meta(gt=0, le=1)] = 0.88
    """Share from which the vehicle lands by itself; 1 for never."""


class VehicleConfig(Table, frozen=True, kw_only=True):
    """One vehicle."""

    transmitter: TransmitterConfig
    """Its radio."""
    type: str = "coaxial"
    """`coaxial`, `coaxial_lag` or `quadrotor`: where its model comes from."""
    host: Name = DEFAULT_HOST
    """Host that runs its agent."""
    spares: list[Name] = field(default_factory=list)
    """Hosts that may run its agent as well: it can be moved there, and the first one that is there starts it
    when nobody commands the vehicle in flight any more."""
    subject: Text
    """Name of the vehicle's subject in the Tracker."""
    control: ControlConfig = field(default_factory=ControlConfig)
    """Its controller and estimator."""
    follow: list[LeaderConfig] = field(default_factory=list)
    """Whom it follows from the start; nobody: it leads."""
    leader_lost: LeaderLostConfig = field(default_factory=LeaderLostConfig)
    """What it does when its leaders are lost."""
    successors: list[Name] = field(default_factory=list)
    """Who leads the followers of this vehicle when it is lost, the first one first; then the others that may,
    in the order of the file."""
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    """When its battery counts as empty."""
    model: dict[str, Any] = field(default_factory=dict)
    """Parameters that differ from those of the type."""


class AvoidanceConfig(Table, frozen=True, kw_only=True):
    """Vehicles keep clear of each other's plans."""

    enabled: bool = True
    """Whether they do."""
    horizontal_m: Annotated[float, Meta(gt=0, le=5)] = 0.35
    """Half axes of the ellipsoid around a vehicle that no other one enters; rotor wash makes it tall."""
    vertical_m: Annotated[float, Meta(gt=0, le=5)] = 0.6
    """The same in height."""


class SafetyConfig(Table, frozen=True, kw_only=True):
    """Limits the transmitter gateway enforces by itself."""

    geofence: bool = True
    """Whether the flight volume is a fence."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Limits of the arbiter that differ from the defaults."""


class LogConfig(Table, frozen=True, kw_only=True):
    """The flight log."""

    host: Name | None = None
    """Host that records; by default the first one."""
    directory: Text | None = None
    """Where flight logs go; default: `RCOPTERX_FLIGHTS`, else `~/.local/share/rcopterx/flights`."""
    keep_gb: Annotated[float, Meta(ge=0.01, le=10_000)] = 10.0
    """Disk that all flight logs of the directory may take together; the oldest are removed for new ones."""
    part_mb: Annotated[float, Meta(ge=1, le=2000)] = 200.0
    """Size from which a flight goes on in another file."""


class WatchdogConfig(Table, frozen=True, kw_only=True):
    """For how long processes may make no progress before they are ended and replaced."""

    enabled: bool = True
    """Switch it off to debug, or start the fleet by `rcopterx up --no-watchdog`."""
    flight_s: Annotated[float, Meta(ge=0.1, le=60)] = 0.15
    """While vehicles fly: shorter than what the inputs of a plan and the hold after them bridge."""
    floor_s: Annotated[float, Meta(ge=0.1, le=60)] = 1.0
    """Otherwise; the spare process always."""
    start_s: Annotated[float, Meta(ge=5, le=600)] = 30.0
    """While a process starts or ends; the simulator and the recorder always."""


class FleetFile(Table, frozen=True, kw_only=True):
    """The whole fleet."""

    name: Name
    """Name of the fleet, part of all keys on the bus."""
    hosts: dict[Name, HostConfig] = field(default_factory=lambda: {DEFAULT_HOST: HostConfig()})
    """Computers by name. Default: one, `main`, that reaches itself."""
    bus: BusConfig = field(default_factory=BusConfig)
    """How processes talk."""
    security: SecurityConfig = field(default_factory=SecurityConfig)
    """Who is let in from other computers."""
    volume: VolumeConfig = field(default_factory=VolumeConfig)
    """Where it flies."""
    tracker: TrackerConfig = field(default_factory=TrackerConfig)
    """The motion capture."""
    simulator: SimulatorConfig | None = None
    """The fake laboratory; without this table the fleet flies hardware."""
    gateways: dict[Name, GatewayConfig] = field(default_factory=lambda: {"transmitters": GatewayConfig()})
    """Transmitter gateways by name. Default: one, `transmitters`, on `main`."""
    avoidance: AvoidanceConfig = field(default_factory=AvoidanceConfig)
    """Keeping clear of each other."""
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    """Limits of the arbiters."""
    log: LogConfig = field(default_factory=LogConfig)
    """The flight log."""
    watchdog: WatchdogConfig = field(default_factory=WatchdogConfig)
    """For how long processes may make no progress."""
    vehicles: dict[Name, VehicleConfig]
    """Vehicles by name."""

    def agent_hosts(self, vehicle: str) -> tuple[str, ...]:
        """Hosts that may run the agent of a vehicle, the one that does so from the start first."""
        config = self.vehicles[vehicle]
        return (config.host, *config.spares)

    def agents_on(self, host: str) -> tuple[str, ...]:
        """Vehicles whose agents may run on a host."""
        return tuple(name for name in self.vehicles if host in self.agent_hosts(name))

    def endpoint(self, host: str) -> str:
        """Zenoh endpoint at which other hosts reach the router of a host."""
        protocol = "tcp" if self.security.certificates is None else "tls"
        return f"{protocol}/{self.hosts[host].address}:{self.hosts[host].router_port}"
