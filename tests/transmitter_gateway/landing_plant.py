"""A vehicle that is not as calibrated, over a floor, flown by an arbiter in virtual time."""

import math
import random
from collections import deque
from copy import copy
from dataclasses import dataclass

from arbiter_bench import SLEW, U_HOVER

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    Action,
    ActionRequest,
    CommandInput,
    Input,
    LastApplied,
    LinkState,
    PoseInput,
    Position,
    State,
)
from rcopterx.vehicles.state import GRAVITY_M_S2

STEP_S = 0.005
COMMAND_S = 0.02
AIR_M = 0.25
"""Above this height a vehicle is in the air."""
SEEN_S = 0.1
BRAKING_S = 1.0
"""A landing that has been seen for so long has braked the vehicle..."""
GENTLE_M_S = 1.0
"""...which then touches down at less than this."""
REST_M_S = 0.1
"""A vehicle that meets the floor more slowly stays there."""
PITCH_GAIN_M_S2 = 2.0


@dataclass(frozen=True)
class Vehicle:
    """True parameters of a vehicle and of the way to it."""

    hover: float = U_HOVER
    slope: float = 1.0
    """Vertical acceleration per thrust, over that of a rotor whose thrust begins at 0."""
    cyclic_gain: float = 1.0
    """Over the nominal one."""
    rotor_lag_s: float = 0.1
    tilt_rad_s: float = 12.0
    tilt_damping: float = 0.7
    delay_s: float = 0.06
    """From the pose to the air."""
    bounce: float = 0.3
    """Speed after the floor over speed before it."""
    kick_m_s: float = 0.0
    """Speed at which the vehicle's electronics make it jump when it first meets the floor."""
    ground_effect: float = 0.08
    """Additional share of the thrust on the floor."""
    discharge_per_s: float = 0.0
    """Growth of the hover thrust."""


@dataclass(frozen=True)
class Tracker:
    """Poses of the vehicle."""

    steps: int = 2
    """Period of the poses, in steps of the plant."""
    noise_m: float = 0.0003
    lost: float = 0.0
    """Share of the poses that do not arrive."""


class Plant:
    """Motion of a vehicle: rotor with lag, tilt that swings, floor at height 0."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.hover = vehicle.hover
        self.position: list[float] = [0.0, 0.0, 0.0]
        self.velocity: list[float] = [0.0, 0.0, 0.0]
        self.tilt = [0.0, 0.0]
        self.tilt_rate = [0.0, 0.0]
        self.thrust = 0.0
        self.on_floor = True
        self.touchdowns_m_s: list[float] = []
        self._kicks = True

    def advance(self, u: Input, dt: float) -> None:
        own, position, velocity = self.vehicle, self.position, self.velocity
        self.thrust += -math.expm1(-dt / own.rotor_lag_s) * (u[2] - self.thrust)
        self.hover = min(self.hover + own.discharge_per_s * dt, 0.9)
        near_floor = 1.0 + own.ground_effect * math.exp(-position[2] / 0.1)
        slope = own.slope * GRAVITY_M_S2 / self.hover
        lift = max(0.0, GRAVITY_M_S2 + slope * (self.thrust - self.hover)) * near_floor
        up = lift - GRAVITY_M_S2
        if self.on_floor and up <= 0.0:
            velocity[:] = self.tilt[:] = self.tilt_rate[:] = [0.0, 0.0, 0.0]
            self.tilt, self.tilt_rate = [0.0, 0.0], [0.0, 0.0]
            return
        self.on_floor = False
        for axis in (0, 1):
            swing = own.tilt_rad_s**2 * (own.cyclic_gain * u[axis] - self.tilt[axis])
            swing -= 2.0 * own.tilt_damping * own.tilt_rad_s * self.tilt_rate[axis]
            self.tilt_rate[axis] += dt * swing
            self.tilt[axis] += dt * self.tilt_rate[axis]
            velocity[axis] += dt * (PITCH_GAIN_M_S2 * self.tilt[axis] - 0.4 * velocity[axis])
            position[axis] += dt * velocity[axis]
        velocity[2] += dt * (up - 0.1 * velocity[2])
        position[2] += dt * velocity[2]
        if position[2] <= 0.0 and velocity[2] < 0.0:
            self._meet_floor()

    def _meet_floor(self) -> None:
        speed_m_s = -self.velocity[2]
        self.touchdowns_m_s.append(speed_m_s)
        up_m_s = self.vehicle.bounce * speed_m_s
        if self._kicks and self.vehicle.kick_m_s > 0.0:
            up_m_s, self._kicks = self.vehicle.kick_m_s, False
        self.position[2] = 0.0
        self.on_floor = up_m_s < REST_M_S
        self.velocity = [0.0, 0.0, 0.0 if self.on_floor else up_m_s]


class Flight:
    """One flight: an agent commands, a Tracker sees, an arbiter decides, the vehicle moves.

    `commanding` and `seeing` are switched by the test, `shift_m` moves the poses.
    """

    def __init__(self, vehicle: Vehicle, tracker: Tracker, seed: int = 0) -> None:
        self.plant = Plant(vehicle)
        self.tracker = tracker
        self.now_s = 1000.0
        self.arbiter = Arbiter("h1", ArbiterLimits(), U_HOVER, SLEW)
        self.arbiter.link(LinkState.READY)
        self.lease = self.arbiter.bid(1, self.now_s, take_over=False)
        self.commanding = self.seeing = True
        self.killed = False
        self.shift_m: Position = (0.0, 0.0, 0.0)
        self.height_m = 0.0
        """Height that the agent flies to."""
        self.climb_m_s = 0.3
        self.place = (0.0, 0.0)
        self.states: list[State] = []
        self.closed_s = 0.0
        """For how long the arbiter has landed the vehicle by true poses."""
        self._touchdowns = 0
        self._flown = False
        self._random = random.Random(seed)
        self._target_m = 0.0
        self._trim = 0.0
        self._step = self._frame = self._sequence = 0
        self._last_u: Input = (0.0, 0.0, 0.0, 0.0)
        under_way = round(vehicle.delay_s / STEP_S)
        self._under_way: deque[Input] = deque(under_way * [self._last_u], maxlen=under_way + 1)

    @property
    def over(self) -> bool:
        return self.arbiter.state not in FLYING

    @property
    def in_the_air(self) -> bool:
        return self.plant.position[2] > AIR_M

    @property
    def seen(self) -> bool:
        """Whether true poses arrive that the arbiter believes."""
        return self.arbiter.pose_monitor.own_motion(self.now_s, SEEN_S) is not None and not any(self.shift_m)

    def arm(self) -> None:
        self.fly(0.6)
        assert self.arbiter.request(ActionRequest(Action.ARM, "operator"), self.now_s).accepted

    def take_off(self, height_m: float) -> None:
        self.arm()
        self._trim = self.plant.hover
        self.height_m = height_m
        self._target_m = 0.0
        for _ in range(round((1.0 + height_m / self.climb_m_s) / 0.1)):
            if not self.over:
                self.fly(0.1)

    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self._advance()

    def until_down(self, limit_s: float = 40.0) -> None:
        for _ in range(round(limit_s / STEP_S)):
            if self.over and self.plant.on_floor:
                return
            self._advance()
        raise AssertionError(f"still {self.arbiter.state} at {self.plant.position[2]:.2f} m")

    def restart_gateway(self, silence_s: float) -> None:
        """Replace the arbiter by a new one; meanwhile the receiver holds its outputs."""
        before, written_s = self.arbiter, self.now_s
        last = LastApplied(
            before.state,
            self._last_u,
            written_s,
            before.leases.commanding,
            before.leases.issued,
            before.hover.value,
            hover_known_s=before.hover.known_s,
            track=copy(before.pose_monitor.own_track),
        )
        for _ in range(round(silence_s / STEP_S)):
            self._move()
        self.arbiter = Arbiter("h1", ArbiterLimits(), U_HOVER, SLEW)
        self.arbiter.link(LinkState.READY)
        self.arbiter.leases.resume(last.lease, last.issued, self.now_s)
        while not self.seen:
            self._move()
            self._show_pose()
        self.arbiter.take_over(last, self.now_s)
        self.closed_s = 0.0

    def kill(self) -> None:
        self.killed = True
        self.arbiter.request(ActionRequest(Action.KILL, "operator"), self.now_s)

    def _advance(self) -> None:
        self._move()
        believed = self.seen
        if self._step % self.tracker.steps == 0 and self.seeing:
            self._show_pose()
        if self._step % round(COMMAND_S / STEP_S) == 0 and self.commanding:
            self._command()
        output = self.arbiter.step(self.now_s)
        self._last_u = (0.0, 0.0, 0.0, 0.0) if output.state not in FLYING else output.u
        if not self.states or self.states[-1] is not output.state:
            self.states.append(output.state)
        self._check(believed)

    def _move(self) -> None:
        self.now_s += STEP_S
        self._step += 1
        self._under_way.append(self._last_u)
        self.plant.advance(self._under_way[0], STEP_S)

    def _show_pose(self) -> None:
        self._frame = self._step // self.tracker.steps
        if self._random.random() < self.tracker.lost:
            return
        noisy = [p + self._random.gauss(0.0, self.tracker.noise_m) for p in self.plant.position]
        x, y, z = (p + shift for p, shift in zip(noisy, self.shift_m, strict=True))
        period_s = self.tracker.steps * STEP_S
        self.arbiter.pose(PoseInput("h1", 7, self._frame, (x, y, z), period_s, 0.0), self.now_s)

    def _command(self) -> None:
        """An agent that sees the truth: it climbs and sinks at its speed and holds its place."""
        dt, plant = COMMAND_S, self.plant
        reach = self.climb_m_s * dt
        self._target_m += min(max(self.height_m - self._target_m, -reach), reach)
        u: Input = (0.0, 0.0, 0.0, 0.0)
        if self.height_m > 0.0:
            gain = plant.vehicle.slope * GRAVITY_M_S2 / plant.hover
            error_m = self._target_m - plant.position[2]
            lift = 3.0 * error_m - 2.5 * plant.velocity[2]
            self._trim = plant.hover
            pitch, roll = (
                min(max((1.6 * (place - p) - 2.0 * v) / PITCH_GAIN_M_S2, -0.8), 0.8)
                for place, p, v in zip(self.place, plant.position, plant.velocity, strict=False)
            )
            u = (pitch, roll, min(max(self._trim + lift / gain, 0.1), 1.0), 0.0)
        self._sequence += 1
        self.arbiter.command(CommandInput(self.lease, 7, self._sequence, self._frame, u), self.now_s)

    def _check(self, seen: bool) -> None:
        """Never off while seen in the air; never hard on the floor after a landing that is seen."""
        touchdowns_m_s = self.plant.touchdowns_m_s
        landing = self.arbiter.state is State.LAND
        self.closed_s = self.closed_s + STEP_S if seen and landing else 0.0
        if len(touchdowns_m_s) > self._touchdowns:
            self._touchdowns = len(touchdowns_m_s)
            assert self.closed_s < BRAKING_S or touchdowns_m_s[-1] < GENTLE_M_S, touchdowns_m_s
        flown, self._flown = self._flown, not self.over
        if self.killed or not (flown and seen and self.in_the_air):
            return
        off = self.over or self._last_u[2] <= self.arbiter.limits.low_thrust
        assert not off, (
            f"{self.arbiter.state}, {self.arbiter.reason}, thrust {self._last_u[2]:.2f} at "
            f"{self.plant.position[2]:.2f} m"
        )
