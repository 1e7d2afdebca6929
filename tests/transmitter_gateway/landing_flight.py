"""An arbiter and a simulated vehicle: hover under commands, then what the arbiter does by itself."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from arbiter_bench import PERIOD_S, Bench
from support.vehicle_types import COAXIAL

from rcopterx.radios.limits import ArbiterLimits, LandingLimits
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.helicopter import Helicopter
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose, Plant
from rcopterx.transmitter_gateway.inputs import FLYING, Input, Position, State
from rcopterx.transmitter_gateway.landing import LandingLaw
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2

POSE_TO_AIR_S = 0.06
HOVER_S = 3.0
LIMIT_S = 20.0


@dataclass(frozen=True)
class Landing:
    """How a flight ended."""

    place_m: Position
    """Where the vehicle was when its commands ended."""
    landed_m: Position
    farthest_m: float
    """Largest horizontal distance from the place."""
    touchdown_m_s: float
    """Speed of the last touchdown."""
    hardest_m_s: float
    """Speed of the hardest touchdown: the first one, if the vehicle hops."""
    seconds: float
    states: tuple[State, ...]
    """In the order they were entered."""
    reason: str
    stick: float
    """Root mean square of pitch and roll."""

    @property
    def offset_m(self) -> float:
        return math.dist(self.place_m[:2], self.landed_m[:2])


@dataclass(frozen=True)
class Options:
    model: Model = COAXIAL
    height_m: float = 0.9
    gain: float = 1.0
    """Of pitch, roll and the thrust's difference from hover, over the nominal one."""
    pitch_acts: float = 1.0
    """Factor on pitch from the moment the commands end: -1 the wrong way round, 0 not at all."""
    pitch_stuck_at: float | None = None
    """Where the pitch stick is stuck from half a second before the commands end; None if it is not."""
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pitch, roll and additional thrust commanded for half a second before the commands end."""
    limits: ArbiterLimits = ArbiterLimits()  # noqa: RUF009 - frozen
    seen: Callable[[float], bool] = lambda seconds: True
    """Whether the Tracker sees the vehicle, by the time since the commands ended."""
    yaw_rad: float = 1.0
    other_m: Position | None = None
    """Where another vehicle hovers from the moment the commands end."""


def landing_limits(model: Model) -> LandingLimits:
    b, k = model.input_gain, model.damping
    return LandingLimits(input_gain=b[:3], yaw_rate_gain_rad_s=-b[3] / k[3])


def hover_of(plant: Plant) -> float:
    """Thrust at which a vehicle hovers with a full battery."""
    if isinstance(plant, Helicopter):
        return GRAVITY_M_S2 / plant.parameters.thrust_gain_m_s2 - plant.parameters.trim[2]
    assert isinstance(plant, FirstOrderPlant)
    return GRAVITY_M_S2 / plant.model.input_gain[2] - plant.trim[2]


class Flight:
    """One vehicle from its hover to the floor, with poses and commands at 50 Hz."""

    def __init__(self, conditions: Conditions, seed: int, options: Options) -> None:
        self.options = options
        conditions = replace(conditions, transport_delay_s=POSE_TO_AIR_S)
        start = BodyPose((0.0, 0.0, options.height_m), options.yaw_rad)
        self.laboratory = Laboratory({"h1": options.model}, {"h1": start}, conditions, seed)
        self.plant = self.laboratory.plants["h1"]
        limits = replace(
            options.limits,
            lower=options.model.input_min,
            upper=options.model.input_max,
            landing=landing_limits(options.model),
        )
        self.bench = Bench(limits, u_hover=options.model.hover_thrust)
        self.bench.position = (0.0, 0.0, 0.0)
        self.bench.arm()
        self.true_hover = hover_of(self.plant)
        self.pilot = LandingLaw(limits.landing)
        self.pitch_acts = 1.0
        self.pitch_stuck_at: float | None = None

    def measure(self) -> None:
        pose = self.laboratory.measured_pose("h1")
        self.bench.position, self.bench.yaw_rad = pose.position_m, pose.yaw_rad

    def act(self, u: Input) -> None:
        gain, hover = self.options.gain, self.true_hover
        pitch = self.pitch_acts * gain * u[0] if self.pitch_stuck_at is None else self.pitch_stuck_at
        self.laboratory.plants["h1"].set_input((pitch, gain * u[1], hover + gain * (u[2] - hover), u[3]))

    def fly(self, seconds: float, add: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        """Hold the place by commands, with something added to them."""
        arbiter = self.bench.arbiter
        for _ in range(round(seconds / PERIOD_S)):
            self.laboratory.advance(PERIOD_S)
            self.measure()
            motion = arbiter.pose_monitor.own_motion(self.bench.now_s, 1.0)
            hover = arbiter.hover.value
            u: Input = (0.0, 0.0, hover, 0.0)
            if motion is not None:
                sunk_m = self.options.height_m - motion.position_m[2]
                u = self.pilot.step(motion, 0.5 * sunk_m, hover, PERIOD_S)
                u = (u[0] + add[0], u[1] + add[1], u[2] + add[2], u[3])
            self.bench.run(PERIOD_S, u)
            self.act(self.bench.outputs[-1].u)
        # It was not seen standing: it appeared in the air.
        arbiter.pose_monitor.take_over(None, None, self.bench.now_s)

    def starve(self, seconds: float) -> None:
        """Let the vehicle fly with its last sticks while nothing on the computer gets a processor."""
        self.laboratory.advance(seconds)
        self.bench.now_s += seconds
        self.bench.frame += round(seconds / PERIOD_S)

    def end_commands(self) -> Landing:
        place = self.plant.pose.position_m
        self.pitch_acts = self.options.pitch_acts
        states: list[State] = []
        farthest_m, hardest_m_s, sticks, seconds = 0.0, 0.0, [], 0.0
        while seconds < LIMIT_S and self.bench.state in FLYING:
            self.laboratory.advance(PERIOD_S)
            seconds += PERIOD_S
            self.measure()
            if not self.options.seen(seconds):
                self.bench.position = None
            if self.options.other_m is not None:
                self.bench.pose("h2", self.options.other_m)
            self.bench.run(PERIOD_S, None)
            output = self.bench.outputs[-1]
            if not states or states[-1] is not output.state:
                states.append(output.state)
            self.act(output.u)
            sticks.append(output.u[0] ** 2 + output.u[1] ** 2)
            farthest_m = max(farthest_m, math.dist(place[:2], self.plant.pose.position_m[:2]))
            hardest_m_s = max(hardest_m_s, self.plant.touchdown_speed_m_s or 0.0)
        self.laboratory.plants["h1"].stop_motors()
        while not self.plant.on_floor:
            self.laboratory.advance(PERIOD_S)
        touchdown_m_s = self.plant.touchdown_speed_m_s
        assert touchdown_m_s is not None
        stick = math.sqrt(sum(sticks) / len(sticks) / 2)
        landed = self.plant.pose.position_m
        return Landing(
            place,
            landed,
            farthest_m,
            touchdown_m_s,
            max(hardest_m_s, touchdown_m_s),
            seconds,
            tuple(states),
            self.bench.reason,
            stick,
        )


def landing(conditions: Conditions, seed: int, options: Options | None = None) -> Landing:
    """Hover, perhaps a push, then silence until the vehicle stands."""
    flight = Flight(conditions, seed, options or Options())
    flight.fly(HOVER_S)
    flight.pitch_stuck_at = flight.options.pitch_stuck_at
    if any(flight.options.push) or flight.pitch_stuck_at is not None:
        flight.fly(0.5, flight.options.push)
    return flight.end_commands()
