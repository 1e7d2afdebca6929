"""One simulated vehicle between its sticks and its pose, for all kinds of vehicles."""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Final

from msgspec import Struct

from rcopterx.simulator.conditions import ADDED, Conditions
from rcopterx.simulator.disturbance import RADIO, TURBULENCE, ColouredNoise, random_stream
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_THRUST, Array
from rcopterx.vehicles.tuples import Four, Three

CALM: Four = (0.0, 0.0, 0.0, 0.0)
PLANTS: Final = "rcopterx.plants"
"""Group of entry points: functions that return a `PlantMaker` for a kind, or raise `ValueError`."""
_TIME_TOLERANCE_S = 1e-9


class BodyPose(Struct, frozen=True):
    """Position, inertial, and rotations about z, body y, body x; positive pitch is nose down, as z is up."""

    position_m: Three
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @property
    def quaternion_xyzw(self) -> Four:
        """Rotation from the body to the inertial frame as a unit quaternion, vector part first."""
        cy, sy = math.cos(self.yaw_rad / 2), math.sin(self.yaw_rad / 2)
        cp, sp = math.cos(self.pitch_rad / 2), math.sin(self.pitch_rad / 2)
        cr, sr = math.cos(self.roll_rad / 2), math.sin(self.roll_rad / 2)
        return (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )

    def above(self, height_m: float) -> Three:
        """Position of a point of the body above its position, lowered by its height in a level body."""
        i, j, k, s = self.quaternion_xyzw
        axis = 2.0 * (i * k + s * j), 2.0 * (j * k - s * i), -2.0 * (i * i + j * j)
        x, y, z = (place + height_m * along for place, along in zip(self.position_m, axis, strict=True))
        return x, y, z


@dataclass(frozen=True, slots=True)
class Wake:
    """Air that rotors push down: the acceleration of a vehicle in it, and how that grows along x and y."""

    down_m_s2: float = 0.0
    slope_x_per_s2: float = 0.0
    slope_y_per_s2: float = 0.0


STILL: Final = Wake()


@dataclass(frozen=True, kw_only=True)
class PlantFaults:
    """Faults of a vehicle: gains (-1 reversed), pitch and roll `exchanged`, `stuck` sticks, thrust left, trim
    and delay of sticks, gain of an attitude loop."""

    stick_gain: Four = (1.0, 1.0, 1.0, 1.0)
    exchanged: bool = False
    stuck: frozenset[int] = frozenset()
    thrust_factor: float = 1.0
    trim: Four = CALM
    delay_s: float = 0.0
    attitude_gain: float = 1.0


class Plant(ABC):
    """A vehicle that flies: delay of its sticks, weather, battery, floor and flight volume; subclasses add
    dynamics.

    Public besides the methods: `load` (use of the battery, 1 in a hover), `on_floor`, `touchdowns`,
    `touchdown_speed_m_s` (of the last one, None before), `motors_running`, `left_volume` (since the start or
    the last `place`), `keeps_attitude` (a firmware does), and three that may be set at any time: `wake`,
    `compensated` (a firmware keeps the thrust while the voltage falls), and `faults`, of which those of the
    sticks act from the next input on.

    It starts standing with motors stopped if the start pose is on the floor (z = 0), else hovering at rest.
    On the floor it stands level and neither slides nor yaws; it leaves when its thrust exceeds its weight.

    `name`: selects the vehicle's streams of randomness. `model`: gives the transport delay, and the thrust
    stick that it starts hovering with. `start`: pose at time 0; z not negative; only position and yaw count.
    `ValueError` for another one.
    """

    def __init__(self, name: str, model: Model, conditions: Conditions, seed: int, start: BodyPose) -> None:
        self._name = name
        self._conditions = conditions
        self._gravity_m_s2 = model.gravity_m_s2
        self._hover_input = four(model.hover_input)
        rms, correlation_s = conditions.turbulence_rms, conditions.turbulence_correlation_s
        stream = random_stream(seed, name, TURBULENCE)
        weather = ColouredNoise(rms, correlation_s, conditions.substep_s, stream)
        self._weather = weather if any(rms) else None
        self._radio_s, delay_s = conditions.radio_period_s, conditions.transport_delay_s
        # A command waits half a radio period on average; that is part of the model's delay.
        self._delay_s = max(model.delay_s - 0.5 * self._radio_s, 0.0) if delay_s is None else delay_s
        self._first_frame_s = self._radio_s * float(random_stream(seed, name, RADIO).uniform())
        self.time_s = 0.0  # flown since the start
        self._hover_seconds_used = 0.0
        endurance_s, full_s = conditions.battery_endurance_s, conditions.charging_s
        self._charged_per_s = endurance_s / full_s if full_s else 0.0
        self.wake, self.compensated = STILL, False
        self.faults = PlantFaults()
        self.keeps_attitude = model.airframe == "attitude"
        self.place(start)

    def place(self, pose: BodyPose) -> None:
        """Put the vehicle somewhere at rest, as by hand: battery, weather and time continue.

        Position and yaw count. On the floor the motors stop, above it the vehicle hovers. Raises `ValueError`
        if the pose is not finite or below the floor.
        """
        x, y, z = pose.position_m
        if not all(map(math.isfinite, (x, y, z, pose.yaw_rad))) or z < 0:
            raise ValueError(f"{self._name}: cannot be placed at {pose}: allowed are finite numbers, z >= 0")
        self.on_floor = z == 0.0
        self.touchdowns = 0
        self.touchdown_speed_m_s: float | None = None
        self.left_volume = False
        self._pending: deque[tuple[float, Four | None]] = deque()
        self._sticks: Four = CALM
        self._thrust_factor = self.thrust_factor * self.faults.thrust_factor
        self._apply(None if self.on_floor else self._hover_input)
        self._settle()
        self._stop(pose.position_m, pose.yaw_rad)

    @property
    def turbulence(self) -> tuple[float, ...]:
        """Accelerations by the air from now on: inertial x, y, z and yaw."""
        return CALM if self._weather is None else self._weather.at(self.time_s + _TIME_TOLERANCE_S)

    @property
    @abstractmethod
    def motion(self) -> tuple[float, ...]:
        """True motion state (8,) as in `rcopterx.vehicles.state`; velocity is turned by the yaw alone."""

    @property
    @abstractmethod
    def pose(self) -> BodyPose:
        """True pose of the body, yaw unwrapped."""

    @property
    def position_m(self) -> Three:
        """True position of the body."""
        x, y, z, *_ = self.motion
        return x, y, z

    @property
    def marker_pose(self) -> BodyPose:
        """Pose of the markers, as a Tracker without noise measures it, yaw unwrapped."""
        return self.pose

    @property
    def used(self) -> float:
        """Share of its charge that the battery has lost."""
        return min(self._hover_seconds_used / self._conditions.battery_endurance_s, 1.0)

    @property
    def thrust_factor(self) -> float:
        """Thrust gain that the battery has left, as a fraction of the full battery's."""
        return 1.0 if self.compensated else 1.0 - self._conditions.battery_sag * self.used

    def set_input(self, inputs: Sequence[float] | Array, after_s: float = 0.0) -> None:
        """Move the sticks (pitch, roll, thrust, yaw, normalised) in `after_s`; they act after the transport
        delay.

        Motors run. Commands act in the order of the calls. Raises `ValueError` if these are not four finite
        numbers, or the time is negative or not finite.
        """
        sticks = four(inputs)
        if not all(map(math.isfinite, sticks)):
            raise ValueError(f"{self._name}: input {sticks} is not finite")
        self._expect(sticks, after_s)

    def stop_motors(self, after_s: float = 0.0) -> None:
        """Cut the motors (throttle pulse at its low end) after the transport delay; see `set_input`."""
        self._expect(None, after_s)

    def _expect(self, sticks: Four | None, after_s: float) -> None:
        if not 0.0 <= after_s < math.inf:
            raise ValueError(f"{self._name}: cannot be commanded after {after_s} s")
        sent_s = self.time_s + after_s
        if self._radio_s:
            frame = math.ceil((sent_s - self._first_frame_s) / self._radio_s - _TIME_TOLERANCE_S)
            sent_s = self._first_frame_s + frame * self._radio_s
        acts_s = sent_s + self._delay_s + self.faults.delay_s
        if self._pending and self._pending[-1][0] == acts_s:
            self._pending.pop()  # the same frame carries the newer command
        self._pending.append((acts_s, sticks))

    def advance(self, duration_s: float) -> None:
        """Advance the time; raises `ValueError` for a duration that is negative or not finite."""
        if not 0.0 <= duration_s < math.inf:
            raise ValueError(f"{self._name}: cannot advance by {duration_s} s")
        end_s, pending = self.time_s + duration_s, self._pending
        while True:
            while pending and pending[0][0] <= self.time_s + _TIME_TOLERANCE_S:
                self._apply(pending.popleft()[1])
            until_s = min(end_s, pending[0][0]) if pending else end_s
            if until_s <= self.time_s:
                return
            steps = max(1, math.ceil((until_s - self.time_s) / self._conditions.substep_s - 1e-6))
            step_s = round((until_s - self.time_s) / steps, 12)
            while steps > 0:
                steps -= self._substeps(steps, step_s)
            self.time_s = until_s

    def _apply(self, inputs: Four | None) -> None:
        self.motors_running = inputs is not None
        if inputs is not None:
            gains, stuck, held = self.faults.stick_gain, self.faults.stuck, self._sticks
            trim = self.faults.trim
            if self.faults.exchanged:
                inputs = (inputs[1], inputs[0], *inputs[2:])
            pitch, roll, thrust, yaw = [
                held[axis] if axis in stuck else gains[axis] * stick + trim[axis]
                for axis, stick in enumerate(inputs)
            ]
            inputs = self._sticks = pitch, roll, max(thrust, 0.0), yaw
        self.load = self._sticks[U_THRUST] / self._hover_input[U_THRUST] if self.motors_running else 0.0
        self._command(inputs)

    def _substeps(self, count: int, step_s: float) -> int:
        """Advance by some substeps, `count` at most; returns how many."""
        if not self.on_floor:
            return self._fly_on(count, step_s)
        self._use_battery(step_s * (self.load if self.motors_running else -self._charged_per_s))
        self.on_floor = self._stand(step_s) <= self._gravity_m_s2
        self.time_s += step_s
        return 1

    def renew_battery(self) -> None:
        """Put a full battery in."""
        self._use_battery(-self._hover_seconds_used)

    def _use_battery(self, hover_seconds: float) -> None:
        self._hover_seconds_used = max(self._hover_seconds_used + hover_seconds, 0.0)
        self._thrust_factor = self.thrust_factor * self.faults.thrust_factor

    def _touch_down(self, speed_m_s: float) -> None:
        self.on_floor = True
        self.touchdowns += 1
        self.touchdown_speed_m_s = speed_m_s
        x, y, _, yaw_rad, *_ = self.motion
        self._stop((x, y, 0.0), yaw_rad)

    @abstractmethod
    def _settle(self) -> None:
        """Move the actuators where the last command has them."""

    @abstractmethod
    def _stop(self, position_m: Three, yaw_rad: float) -> None:
        """Come to rest, level; actuators stay as they are."""

    @abstractmethod
    def _command(self, sticks: Four | None) -> None:
        """Take sticks that have passed the delay; None stops the motors."""

    @abstractmethod
    def _stand(self, step_s: float) -> float:
        """Move the actuators while the vehicle stands; returns the thrust over the mass."""

    @abstractmethod
    def _fly_on(self, count: int, step_s: float) -> int:
        """Fly on by some substeps, `count` at most and none after the floor is met; returns how many."""


class SteppedPlant(Plant):
    """A plant that flies one substep after the other."""

    def _fly_on(self, count: int, step_s: float) -> int:  # noqa: ARG002 - one at a time is as good
        self._use_battery(step_s * self.load)
        x, y, z, yaw = CALM if self._weather is None else self._weather.at(self.time_s + step_s / 2)
        self._fly(step_s, (x, y, z - self.wake.down_m_s2, yaw))
        self._meet_room()
        self.time_s += step_s
        return 1

    def _meet_room(self) -> None:
        """Land if the floor is reached, flag the flight volume."""
        x, y, z, _, _, _, climb_m_s, _ = self.motion
        if z <= 0.0 and climb_m_s < 0.0:
            self._touch_down(-climb_m_s)
        low, high = self._conditions.volume_min_m, self._conditions.volume_max_m
        inside = low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]
        self.left_volume |= not inside

    @abstractmethod
    def _fly(self, step_s: float, weather: Four) -> None:
        """Fly on under inertial accelerations by the air: x, y, z and yaw."""


def four(numbers: Sequence[float] | Array) -> Four:
    """Four stick positions as floats; raises `ValueError` if there are not four."""
    if len(numbers) != 4:
        raise ValueError(f"{len(numbers)} inputs given, a vehicle has 4: pitch, roll, thrust, yaw")
    pitch, roll, thrust, yaw = map(float, numbers)
    return pitch, roll, thrust, yaw


PlantMaker = Callable[[str, Model, Conditions, int, BodyPose], Plant]
"""Makes the plant of a vehicle by its name, model, conditions, seed and start pose."""


def added_plant(name: str) -> PlantMaker:
    """Return what makes a plant PACKAGE:KIND of an installed package; `ValueError` if there is none."""
    package, _, kind = name.partition(ADDED)
    for point in entry_points(group=PLANTS, name=package):
        found: PlantMaker = point.load()(kind)
        return found
    raise ValueError(
        f"no installed package has the plant {name}; drone_models is part of rcopterx-studies: "
        "pip install 'rcopterx-studies[physics]'"
    )
