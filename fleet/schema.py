"""The tables of a fleet file as types, with defaults, units and limits.

The docstrings of fields are the user documentation in `docs/fleet_file.md`.
"""

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from rcopterx.bus.clock import LOCKSTEP, REAL_TIME, Clock
from rcopterx.bus.message import Four, Name, Period, Place, Three
from rcopterx.bus.messages import LeaderLink, Zone
from rcopterx.fleet.errors import FleetError as FleetError
from rcopterx.fleet.errors import check_known as check_known
from rcopterx.fleet.errors import errors_at as errors_at
from rcopterx.user_text import is_loopback

Text = Annotated[str, Meta(min_length=1)]
Speed = Annotated[float, Meta(ge=0.01, le=10)]
ProtocolName = Literal["multi", "dsm2_serial", "dsmp", "ppm", "crazyflie", "mavlink"]

DEFAULT_HOST = "main"
ROUTER_PORT = 7447


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the fleet file."""


class VolumeConfig(Table, frozen=True, kw_only=True):
    """Flight volume in the inertial frame."""

    min_m: Three = (-1.2, -1.2, 0.0)
    """Lowest x, y, z. A volume may begin above the floor, which is then at z = 0."""
    max_m: Three = (1.2, 1.2, 2.0)
    """Highest x, y, z. Set points outside are refused, vehicles outside are brought down."""


class TrackerConfig(Table, frozen=True, kw_only=True):
    """The motion capture."""

    host: Name = DEFAULT_HOST
    """Host that runs the gateway."""
    address: str = "127.0.0.1:801"
    """HOST:PORT of the data stream."""
    brand: str = "vicon"
    """`vicon` uses our own client; all others, `vicon_sdk` included, use the library `motioncapture`."""
    rate_hz: Annotated[float, Meta(gt=0, le=2000)] | None = None
    """Capture rate, for brands that do not report it."""
    latency_s: Annotated[float, Meta(ge=0, le=1)] | None = None
    """Time from capture to arrival, for brands that do not report it."""
    settings: dict[str, str] = field(default_factory=dict)
    """Further settings of the library, by its own names."""
    record_raw: Text | None = None
    """File for the raw stream, below `~/` or relative to the directory in which the gateway is started."""


class SimulatorConfig(Table, frozen=True, kw_only=True):
    """The simulated laboratory. Without this table the fleet flies hardware."""

    host: Name = DEFAULT_HOST
    """Host of the simulator and of all transmitter gateways."""
    rate_hz: Annotated[float, Meta(ge=20, le=400)] = 50.0
    """Frame rate of the simulated Tracker."""
    profile: Literal["tracker1", "tracker2", "tracker3"] = "tracker3"
    """Emulated generation of the Tracker."""
    seed: Annotated[int, Meta(ge=0)] = 0
    """Seed of the random vehicles, noise and wind."""
    speed: Speed = 1.0
    """How fast the time of the fleet passes: 1 in real time, 0.2 five times slower, for slow computers."""
    lockstep: bool = False
    """Time stands still until all processes have finished their work: no control period is missed, and all
    flights are identical. `speed` has no meaning then."""
    conditions: str = "helicopter"
    """Preset: ideal, laboratory, helicopter, helicopters, coaxes, crazyflies or vicon_crazyflie."""
    condition_overrides: dict[str, Any] = {}
    """Values that differ from the preset."""
    start: dict[Name, Four] = {}
    """Initial x, y, z [m] and yaw [rad] by vehicle; by default the place in the formation, on the floor."""


class HostConfig(Table, frozen=True, kw_only=True):
    """A computer that runs part of the fleet."""

    address: str = "127.0.0.1"
    """Address at which other hosts reach it."""
    router_port: Annotated[int, Meta(ge=1, le=65535)] | None = None
    """TCP port of the bus router. Default: 7447, but none in a fleet of one computer without certificates."""
    steering: bool = True
    """Whether operators may steer through the router of this host, in a fleet with certificates."""


class BusConfig(Table, frozen=True, kw_only=True):
    """The bus and the scheduling of processes."""

    namespace: Name | None = None
    """Prefix of all keys that separates fleets in tests; not needed in a laboratory."""
    realtime_priority: Annotated[int, Meta(ge=0, le=90)] = 20
    """SCHED_FIFO priority, where the operating system permits it; 0 for none."""


class SecurityConfig(Table, frozen=True, kw_only=True):
    """Access from other computers."""

    certificates: Text | None = None
    """Directory of the certificates that `rcopterx certs` makes, on every host: an absolute path, or one that
    begins with `~/`. With certificates hosts and people are authenticated, and the bus is encrypted."""
    insecure: bool = False
    """Allow hosts on a network without certificates: every program that reaches them can steer."""
    operators: list[Name] = field(default_factory=lambda: ["lab"])
    """People and programs on other computers that may steer."""
    watchers: list[Name] = field(default_factory=lambda: ["lab"])
    """People and programs on other computers that may only watch."""


class GatewayConfig(Table, frozen=True, kw_only=True):
    """A transmitter gateway process."""

    host: Name = DEFAULT_HOST
    """Host the radio modules are plugged into."""


class TransmitterConfig(Table, frozen=True, kw_only=True):
    """A vehicle's transmitter."""

    port: Text
    """Serial device; a relative path is in the run directory, where the simulator creates it. For a Crazyflie
    `radio://DONGLE/CHANNEL/RATE/ADDRESS`, or `udp://HOST:PORT` of a simulated one; for a vehicle with MAVLink
    a serial device or `udp://HOST:PORT`."""
    gateway: Name = "transmitters"
    """Transmitter gateway that serves it."""
    protocol: ProtocolName | None = None
    """Protocol of the radio module; by default that of the vehicle's type."""
    model_match: Annotated[int, Meta(ge=0, le=63)] = 0
    """Number that binds the receiver to this transmitter; unique for each vehicle."""
    low_power: bool = False
    """Whether the radio sends with low power."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the protocol that differ from those of the type."""
    calibration: dict[str, Any] = field(default_factory=dict)
    """Map from normalised inputs to pulse widths, by channel, where it differs from that of the type."""


class ControlConfig(Table, frozen=True, kw_only=True):
    """Controller and estimator of a vehicle."""

    controller: str = "cascade"
    """Name of a controller of this package or of an installed one."""
    estimator: str = "extended_kalman"
    """Name of an estimator of this package or of an installed one."""
    horizon: Annotated[int, Meta(ge=2, le=200)] = 50
    """Number of stages N."""
    period_s: Period = 0.02
    """Control period; a whole multiple of the Tracker's frame period."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the controller: weights, constraints, options."""
    estimator_settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the estimator."""
    leader_wait_s: Annotated[float, Meta(ge=0, le=0.015)] = 0.003
    """How long after its own pose a follower waits for the leader's plan of the same frame, for each level of
    leaders above it; at most half a control period."""
    deviation_share: Annotated[float, Meta(ge=0, le=1)] = 0.25
    """Share of a leader's deviation from its undisturbed reference that a follower copies: 1 follows the
    leader's plan alone, as in the paper, 0 the set points of the head of the formation."""


class LeaderConfig(LeaderLink, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Leader of a vehicle from the start, and the offset to it."""

    offset_m: Place
    frame: Literal["inertial", "heading"] = "inertial"


class LeaderLostConfig(Table, frozen=True, kw_only=True):
    """What a follower does when its leaders are lost and their last plans have ended."""

    then: Literal["hold", "promote", "land"] = "hold"
    """Keep the place; follow a successor or become one; or land."""
    after_s: Annotated[float, Meta(ge=0.5, le=60)] = 2.0
    """Time for which it first keeps its place and waits for its leaders."""


Volts = Annotated[float, Meta(ge=0, le=100)]


class VoltageConfig(Table, frozen=True, kw_only=True, omit_defaults=True):
    """What the voltage of a battery permits, where the radio reports it; 0 for no such limit."""

    warn_v: Volts | None = None
    """Voltage of the whole battery below which the vehicle does not take off; a warning in flight [V]."""
    land_v: Volts | None = None
    """Voltage below which it lands, after 5 s [V]."""
    full_v: Volts | None = None
    """Voltage of a full battery, where the bar ends that shows it [V]."""
    hover_s: Annotated[float, Meta(ge=0, le=86_400)] | None = None
    """How long the vehicle hovers with a full battery until it lands, for predictions; 0 for none."""


class BatteryConfig(VoltageConfig, frozen=True, kw_only=True):
    """When a battery counts as empty: by its voltage, and by the thrust that the vehicle needs to hover.

    Voltages that are not given are those of the type.
    """

    warn_at_thrust: Annotated[float, Meta(gt=0, le=1)] = 0.8
    """Share of the largest thrust above which a warning is shown."""
    land_at_thrust: Annotated[float, Meta(gt=0, le=1)] = 0.88
    """Share above which the vehicle lands by itself; 1 for never."""


class VehicleConfig(Table, frozen=True, kw_only=True):
    """One vehicle."""

    transmitter: TransmitterConfig
    """Its radio."""
    type: str = "coaxial"
    """Type that gives the defaults of model, calibration and radio: a name that `rcopterx types` lists, one
    of `types`, or the path of a file `*.toml`, relative to the fleet file or below `~/`."""
    host: Name = DEFAULT_HOST
    """Host that runs its agent."""
    spares: list[Name] = field(default_factory=list)
    """Hosts that may also run its agent: it can be moved there, and the first of them that is up starts it
    when the vehicle gets no commands in flight."""
    subject: Text
    """Name of the vehicle's subject in the Tracker."""
    control: ControlConfig = field(default_factory=ControlConfig)
    """Its controller and estimator."""
    follow: list[LeaderConfig] = field(default_factory=list)
    """Its leaders from the start; without any it leads."""
    leader_lost: LeaderLostConfig = field(default_factory=LeaderLostConfig)
    """What it does when its leaders are lost."""
    successors: list[Name] = field(default_factory=list)
    """Vehicles that lead its followers when it is lost, in this order; then others that may lead, in that of
    the file."""
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    """When its battery counts as empty."""
    model: dict[str, Any] = field(default_factory=dict)
    """Parameters of the model that differ from those of the type."""
    learning: bool = True
    """Whether it may fly with a model that it learns in ordinary flight, unless `model` is identified."""


class SubjectConfig(Table, frozen=True, kw_only=True):
    """Something that the motion capture tracks and that is no vehicle: vehicles follow or avoid it."""

    subject: Text | None = None
    """Name of the subject in the Tracker; by default the own name."""
    margin_m: Annotated[float, Meta(ge=0, le=5)] = 0.1
    """How much farther vehicles keep from it than from each other, its uncertain motion not counted."""


class AvoidanceConfig(Table, frozen=True, kw_only=True):
    """How vehicles keep clear of each other's plans."""

    enabled: bool = True
    """Whether they keep clear."""
    horizontal_m: Annotated[float, Meta(gt=0, le=5)] = 0.35
    """Horizontal half axis of the ellipsoid around a vehicle that other vehicles do not enter."""
    vertical_m: Annotated[float, Meta(gt=0, le=5)] = 0.6
    """Vertical half axis; larger because of the rotor wash."""


class SafetyConfig(Table, frozen=True, kw_only=True):
    """Limits that the transmitter gateway enforces."""

    geofence: bool = True
    """Whether the gateway brings down vehicles outside the flight volume."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Limits of the arbiter that differ from the defaults."""


class LogConfig(Table, frozen=True, kw_only=True):
    """The flight log."""

    host: Name | None = None
    """Host that records; by default the first one."""
    directory: Text | None = None
    """Directory of flight logs; by default `RCOPTERX_FLIGHTS`, else `~/.local/share/rcopterx/flights`."""
    keep_gb: Annotated[float, Meta(ge=0.01, le=10_000)] = 10.0
    """Disk space of the flight logs of this fleet in the directory; the oldest are removed."""
    part_mb: Annotated[float, Meta(ge=1, le=2000)] = 200.0
    """Size of a file of a flight log, after which the next file begins."""


class WatchdogConfig(Table, frozen=True, kw_only=True):
    """For how long processes may make no progress before they are killed and replaced."""

    enabled: bool = True
    """False for debugging, as `rcopterx up --no-watchdog`."""
    flight_s: Annotated[float, Meta(ge=0.1, le=60)] = 0.15
    """While vehicles fly; must be shorter than `descend_after_s` of all vehicles (0.2 by default): they land
    when commands are older."""
    floor_s: Annotated[float, Meta(ge=0.1, le=60)] = 1.0
    """While no vehicle flies; always for spare processes."""
    start_s: Annotated[float, Meta(ge=5, le=600)] = 30.0
    """While a process starts or ends; always for the simulator, the recorder and the learner."""


class FleetFile(Table, frozen=True, kw_only=True):
    """The whole fleet."""

    name: Name
    """Name of the fleet, part of all keys on the bus."""
    hosts: dict[Name, HostConfig] = field(default_factory=lambda: {DEFAULT_HOST: HostConfig()})
    """Computers by name; by default one, `main`."""
    bus: BusConfig = field(default_factory=BusConfig)
    """The bus and the scheduling of processes."""
    security: SecurityConfig = field(default_factory=SecurityConfig)
    """Access from other computers."""
    volume: VolumeConfig = field(default_factory=VolumeConfig)
    """Flight volume."""
    zones: dict[Name, Zone] = field(default_factory=dict)
    """Keep-out zones by name."""
    tracker: TrackerConfig = field(default_factory=TrackerConfig)
    """The motion capture."""
    simulator: SimulatorConfig | None = None
    """The simulated laboratory; without this table the fleet flies hardware."""
    gateways: dict[Name, GatewayConfig] = field(default_factory=lambda: {"transmitters": GatewayConfig()})
    """Transmitter gateways by name; by default one, `transmitters`, on `main`."""
    avoidance: AvoidanceConfig = field(default_factory=AvoidanceConfig)
    """How vehicles keep clear of each other."""
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    """Limits that the transmitter gateway enforces."""
    log: LogConfig = field(default_factory=LogConfig)
    """The flight log."""
    watchdog: WatchdogConfig = field(default_factory=WatchdogConfig)
    """For how long processes may make no progress."""
    learning: bool | None = None
    """Whether vehicles learn their models in ordinary flight; by default they do, but not in lockstep."""
    types: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Vehicle types of this fleet by name; see [vehicle_types.md](vehicle_types.md)."""
    vehicles: dict[Name, VehicleConfig]
    """Vehicles by name."""
    subjects: dict[Name, SubjectConfig] = field(default_factory=dict)
    """Tracked subjects that are no vehicles, by name."""

    @property
    def clock(self) -> Clock:
        """The clock of the fleet; hardware flies in real time."""
        if self.simulator is None:
            return Clock()
        return LOCKSTEP if self.simulator.lockstep else Clock(self.simulator.speed)

    @property
    def title(self) -> str:
        """Name of the fleet, and how fast its time passes if that is not real time."""
        clock = self.clock
        pace = "lockstep" if clock.lockstep else f"{clock.speed:g} x real time"
        return self.name if clock == REAL_TIME else f"{self.name} ({pace})"

    @property
    def tracked(self) -> dict[str, str]:
        """Subject in the Tracker of every vehicle, and of every subject that is none."""
        vehicles = {name: vehicle.subject for name, vehicle in self.vehicles.items()}
        return vehicles | {name: one.subject or name for name, one in self.subjects.items()}

    def agent_hosts(self, vehicle: str) -> tuple[str, ...]:
        """Return the hosts that may run the agent of a vehicle, its own first."""
        config = self.vehicles[vehicle]
        return (config.host, *config.spares)

    def agents_on(self, host: str) -> tuple[str, ...]:
        """Return the vehicles whose agents may run on a host."""
        return tuple(name for name in self.vehicles if host in self.agent_hosts(name))

    def served_by(self, gateway: str) -> tuple[str, ...]:
        """Return the vehicles whose transmitters a gateway serves."""
        return tuple(name for name, one in self.vehicles.items() if one.transmitter.gateway == gateway)

    def transmitters_on(self, host: str) -> tuple[str, ...]:
        """Return the vehicles whose transmitter gateways run on a host."""
        return tuple(
            name for name, one in self.vehicles.items() if self.gateways[one.transmitter.gateway].host == host
        )

    def router_port(self, host: str) -> int:
        """Return the TCP port at which others reach the router of a host."""
        return self.hosts[host].router_port or ROUTER_PORT

    def listens(self, host: str) -> bool:
        """Whether the router of a host listens for others than processes of its own user on its computer."""
        place = self.hosts[host]
        alone = len(self.hosts) == 1 and is_loopback(place.address) and self.security.certificates is None
        return place.router_port is not None or not alone

    def endpoint(self, host: str) -> str:
        """Return the Zenoh endpoint at which others reach the router of a host, if it listens for them."""
        protocol = "tcp" if self.security.certificates is None else "tls"
        address = self.hosts[host].address
        return f"{protocol}/{f'[{address}]' if ':' in address else address}:{self.router_port(host)}"
