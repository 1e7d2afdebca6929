"""The simulated laboratory without wires: vehicles flying together, and poses as a Tracker measures them."""

import math
from collections.abc import Mapping
from dataclasses import astuple
from typing import Final

from rcopterx.simulator.conditions import FIRST_ORDER, Conditions
from rcopterx.simulator.disturbance import NOISE, random_stream
from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.helicopter import Helicopter, helicopter_of
from rcopterx.simulator.plant import STILL, BodyPose, Plant, Wake, added_plant
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tuples import Three

CLOSE_M: Final = 0.3
"""Distance below a rotor up to which its downwash is at full strength; beyond, it falls with 1 / distance."""
BEGIN_M: Final = 0.1  # distance below a rotor over which its downwash develops
WIDTH_M: Final = 0.1
SPREAD: Final = 0.2
"""Horizontal distance at which it has fallen by e: at the rotor, and what is added per distance below."""
ROTOR_RADIUS_M: Final = 0.1  # radius of the rotors that walls and the ceiling act on
CEILING_NEAR: Final = 0.25
CEILING_FAR: Final = 3.0
"""Distances of the ceiling in radii: below the first it acts no stronger, beyond the second not at all."""
WALL_SHARE: Final = 0.05
"""Part of the thrust by which the edge of a rotor that touches a wall has less than its middle."""


def wake_below(x_m: float, y_m: float, below_m: float, strength_m_s2: float) -> Wake:
    """Wake of a vehicle in flight at a place relative to it; none at its height and above.

    `strength_m_s2` is the downward acceleration close below it.
    """
    if below_m <= 0.0:
        return STILL
    width_m = WIDTH_M + SPREAD * below_m
    share = min(below_m / BEGIN_M, CLOSE_M / below_m, 1.0)
    down = strength_m_s2 * share * math.exp(-(x_m**2 + y_m**2) / width_m**2)
    return Wake(down, -2.0 * x_m / width_m**2 * down, -2.0 * y_m / width_m**2 * down)


def ceiling_lift(distance_m: float) -> float:
    """Thrust that the ceiling adds, as a fraction: momentum theory at constant power.

    It is zero from `CEILING_FAR` on and above the ceiling.
    """
    if distance_m < 0.0:
        return 0.0

    def thrust(radii: float) -> float:
        return math.pow(0.5 + 0.5 * math.sqrt(1.0 + 0.125 / radii**2), 2.0 / 3.0)

    radii = min(max(distance_m / ROTOR_RADIUS_M, CEILING_NEAR), CEILING_FAR)
    return thrust(radii) - thrust(CEILING_FAR)


def wall_slope(distance_m: float) -> float:
    """Growth towards a wall of the downward acceleration by air that comes back from it [1/s^2].

    It begins one radius off the blades, and is full where they touch; there is none behind the wall.
    """
    if distance_m < 0.0:
        return 0.0
    share = min(max(2.0 - distance_m / ROTOR_RADIUS_M, 0.0), 1.0)
    return share * WALL_SHARE * GRAVITY_M_S2 / ROTOR_RADIUS_M


def wake_in_room(position_m: Three, low_m: Three, high_m: Three) -> Wake:
    """Wake that comes back to a vehicle in flight from the walls and the ceiling of a volume."""
    x, y, z = position_m
    return Wake(
        -GRAVITY_M_S2 * ceiling_lift(high_m[2] - z),
        wall_slope(high_m[0] - x) - wall_slope(x - low_m[0]),
        wall_slope(high_m[1] - y) - wall_slope(y - low_m[1]),
    )


def plant_of(name: str, model: Model, conditions: Conditions, seed: int, start: BodyPose) -> Plant:
    """Plant of a vehicle at time 0: equation (1), or what the conditions require for its airframe.

    Raises `ValueError` for a start pose that is not finite or below the floor, and for a plant that is not
    installed.
    """
    if model.airframe == "coaxial" and conditions.coaxial_plant != FIRST_ORDER:
        return Helicopter(name, model, conditions, seed, start, helicopter_of(name, conditions, seed))
    if model.airframe == "attitude" and conditions.attitude_plant != FIRST_ORDER:
        return added_plant(conditions.attitude_plant)(name, model, conditions, seed, start)
    return FirstOrderPlant(name, model, conditions, seed, start)


class Laboratory:
    """Vehicles that advance together: `plants` by name.

    The same inputs lead to exactly the same flight. Order and number of the models do not change what happens
    to each vehicle. A vehicle that starts on the floor (z = 0) stands with motors stopped, else it hovers.
    Raises `ValueError` if models and start poses differ in their vehicles, or for a negative seed.
    """

    def __init__(
        self,
        models: Mapping[str, Model],
        start: Mapping[str, BodyPose],
        conditions: Conditions,
        seed: int = 0,
    ) -> None:
        if seed < 0:
            raise ValueError(f"laboratory: seed {seed} is negative")
        if odd := sorted(models.keys() ^ start.keys()):
            raise ValueError(f"laboratory: {', '.join(odd)}: each vehicle needs a model and a start pose")
        self._conditions = conditions
        self.plants = {
            name: plant_of(name, model, conditions, seed, start[name]) for name, model in models.items()
        }
        self._noise = {name: random_stream(seed, name, NOISE) for name in models}

    def advance(self, duration_s: float) -> None:
        """Advance all vehicles by a duration, not negative, under the wakes at its start."""
        if self._conditions.downwash_m_s2 or self._conditions.walls:
            self._set_wakes(self._conditions)
        for plant in self.plants.values():
            plant.advance(duration_s)

    def _set_wakes(self, conditions: Conditions) -> None:
        """Set the wakes that every plant is in: of all others that fly now, and its own that comes back."""
        places = [(plant, plant.position_m) for plant in self.plants.values()]
        flying = [(plant, place) for plant, place in places if plant.motors_running and not plant.on_floor]
        for plant, (x, y, z) in places:
            wakes = [
                wake_below(x - above[0], y - above[1], above[2] - z, conditions.downwash_m_s2)
                for other, above in flying
                if above[2] > z and other is not plant
            ]
            if conditions.walls and plant.motors_running:
                wakes.append(wake_in_room((x, y, z), conditions.volume_min_m, conditions.volume_max_m))
            plant.wake = Wake(*(sum(parts) for parts in zip(*map(astuple, wakes), strict=True)))

    def seen_pose(self, name: str) -> BodyPose | None:
        """Pose as `measured_pose`, or None in a frame in which the Tracker misses the vehicle."""
        missed = self._conditions.dropout_fraction
        if missed and self._noise[name].random() < missed:
            return None
        return self.measured_pose(name)

    def measured_pose(self, name: str) -> BodyPose:
        """Pose of the markers of vehicle `name` as measured now: with fresh noise, yaw wrapped."""
        pose = self.plants[name].marker_pose
        position_m, angle_rad = self._conditions.position_noise_m, self._conditions.angle_noise_rad
        noise = self._noise[name].standard_normal(6).tolist()
        origin_m = pose.above(self._conditions.lever_arm_m)
        x, y, z = (place + position_m * each for place, each in zip(origin_m, noise[:3], strict=True))
        yaw, pitch, roll = (angle_rad * each for each in noise[3:])
        yaw_rad = math.remainder(pose.yaw_rad + yaw, math.tau)
        return BodyPose((x, y, z), yaw_rad, pose.pitch_rad + pitch, pose.roll_rad + roll)
