"""Limits of the arbiter (docs/safety.md) with their defaults."""

import math
from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Any

from rcopterx.vehicles.lift_off import LiftOffLimits
from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tuples import Four, Three

FAREWELL_S = 2.0
"""For the throttle-low frames at the end, on a busy computer."""
DESCENT_BEGINS_S = 0.7
"""Until a vehicle without poses sinks, and for the drag of its rotor."""
SLOWER = 1.6
"""Longest descent without poses over that of a vehicle whose hover thrust is as learned."""
LONGEST_DESCENT_S = 5.5
GENTLE_SHARE = 0.05
GENTLE_M_S = 0.8
"""Once it sinks this fast, a descent without poses leaves out no more than this share of the hover thrust."""


class LimitsError(ValueError):
    """A limit that makes no sense; the message names the field."""


def _require_positive(limits: Any, prefix: str, others: Collection[str] = ()) -> None:
    """Refuse limits of which a number, None excepted, is not positive; `others` may be."""
    for name in (item.name for item in fields(limits) if item.name not in others):
        value = getattr(limits, name)
        for number in value if isinstance(value, tuple) else (value,):
            if number is not None and not (math.isfinite(number) and number > 0):
                raise LimitsError(f"{prefix}{name}: {number} must be a positive number")


@dataclass(frozen=True, slots=True)
class Fence:
    """Box the vehicle must stay in."""

    lower_m: Three
    upper_m: Three
    """`lower_m`, `upper_m`: corners in the inertial frame."""
    margin_m: float = 0.1
    """Distance outside the box at which the vehicle is brought down."""
    cut_m: float = 5.0
    """Distance outside the box at which the motors of a vehicle are cut that the arbiter lands and that does
    not obey its sticks."""
    braking_m_s2: Three = (2.0, 2.0, 2.0)
    """Deceleration a healthy vehicle reaches on each axis: one too fast to stop inside the box is held."""

    def __post_init__(self) -> None:
        for axis, lower, upper in zip("xyz", self.lower_m, self.upper_m, strict=True):
            if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
                raise LimitsError(f"fence.upper_m: {axis} = {upper} must be above lower_m {axis} = {lower}")
        if not (math.isfinite(self.margin_m) and self.margin_m >= 0):
            raise LimitsError(f"fence.margin_m: {self.margin_m} must not be negative")
        if not (math.isfinite(self.cut_m) and self.cut_m > self.margin_m):
            raise LimitsError(f"fence.cut_m: {self.cut_m} must be above margin_m = {self.margin_m}")
        _require_positive(self, "fence.", ("lower_m", "upper_m", "margin_m"))

    def beside(self, position_m: Three) -> bool:
        """Whether a place is within the sides of the box and its margin, at any height."""
        return all(self._within(position_m, self.margin_m)[:2])

    def left(self, position_m: Three) -> bool:
        """Whether a vehicle is so far outside that its motors are to be cut."""
        return not all(self._within(position_m, self.cut_m))

    def _within(self, position_m: Three, beyond_m: float) -> list[bool]:
        """Whether a place is at most so far outside, by axis."""
        sides = zip(position_m, self.lower_m, self.upper_m, strict=True)
        return [lower - beyond_m <= p <= upper + beyond_m for p, lower, upper in sides]


@dataclass(frozen=True, slots=True)
class SurveillanceLimits:
    """Limits judged from raw poses; None switches a judgement off."""

    tracking_hold_s: float | None = 0.1
    tracking_descend_s: float | None = 0.3
    """`tracking_hold_s`, `tracking_descend_s`: time without a usable own pose before HOLD and DESCEND."""
    fence: Fence | None = None
    """Box to stay in. It depends on the laboratory, so there is none by default."""
    minimum_distance_m: float | None = 0.3
    """Smallest distance between two vehicles; below it HOLD."""
    distance_hysteresis_m: float = 0.05
    """Additional distance before the vehicles count as apart again."""
    other_pose_s: float = 0.5
    """Time for which the last position of another vehicle is used."""
    maximum_thrust_s: float | None = None
    """Longest time with thrust between arming and disarming; then DESCEND."""
    maximum_jump_m: float | None = 0.1
    """A position further than this from where the vehicle can be is rejected."""
    maximum_speed_m_s: float = 2.5
    """Growth of that distance with the time since the last accepted position."""
    jump_descend_s: float = 0.3
    """Time of rejection after which the vehicle comes down for good: it may be another body."""
    velocity_filter_s: float = 0.05
    """Time constant of the low-pass on the finite-difference velocity."""
    trust_repeated_poses: bool = True
    """Whether a position that equals the last one counts as seen. Measurements never repeat
    themselves exactly. In the air such a pose does not count; on the floor it is frozen after
    `standing.repeated_s`."""

    def __post_init__(self) -> None:
        _require_positive(self, "", ("fence", "trust_repeated_poses"))
        hold, descend = self.tracking_hold_s, self.tracking_descend_s
        if hold is not None and descend is not None and descend < hold:
            raise LimitsError(f"tracking_descend_s: {descend} must not be below tracking_hold_s = {hold}")


@dataclass(frozen=True, slots=True)
class LandingLimits:
    """Model of the vehicle for holding and landing, and limits of the law."""

    input_gain: Three = (2.0, 2.1, 18.0)
    """Nominal acceleration per unit of pitch, roll and thrust [m/s^2]."""
    yaw_rate_gain_rad_s: float = 22.2
    """Nominal yaw rate per unit of yaw."""
    cyclic: float = 0.8
    thrust: float = 0.2
    yaw: float = 0.1
    """`cyclic`, `thrust`, `yaw`: largest pitch and roll, difference from the hover thrust, and yaw."""
    descent_m_s: float = 0.4
    """Speed of the descent."""
    touchdown_m_s: float = 0.25
    flare_m: float = 0.2
    """`touchdown_m_s`, `flare_m`: slower speed just above the floor, and the height where it begins."""
    braked_m_s: float = 0.3
    braking_s: float = 1.5
    """`braked_m_s`, `braking_s`: the descent begins when the vehicle is slower than this, or after this time.
    """
    pose_age_s: float = 0.1
    """A vehicle whose last accepted pose is older is not seen."""
    longest_s: float = 20.0
    """Longest landing; then the vehicle comes down open loop."""

    def __post_init__(self) -> None:
        _require_positive(self, "landing.")


@dataclass(frozen=True, slots=True)
class StandingLimits:
    """What is plausible of the pose of a vehicle on the floor, before it is armed."""

    watched_s: float = 0.5
    """How long the vehicle must have been seen there."""
    repeated_s: float = 0.5
    """A position that repeats itself exactly for so long is frozen."""
    below_m: float = 0.1
    highest_m: float = 0.3
    """`below_m`, `highest_m`: how far below the floor (`floor_m`) its origin may be, and how high above, on
    its legs and on a mat; more for take-offs from a table."""
    tilt_rad: float = 0.35
    """Largest angle between its axis and the vertical."""
    moved_m: float = 0.02
    rest_s: float = 1.0
    """`moved_m`, `rest_s`: it must not have moved by more within this time."""
    apart_m: float = 0.05
    """Two vehicles that are closer to each other are one body."""

    def __post_init__(self) -> None:
        _require_positive(self, "standing.")


@dataclass(frozen=True, slots=True)
class ArbiterLimits:
    """Times, input limits and rates of the arbiter."""

    hold_after_s: float = 0.06
    descend_after_s: float = 0.2
    cut_after_s: float = 2.0
    """`hold_after_s`, `descend_after_s`, `cut_after_s`: age of the last accepted command at which HOLD, LAND
    or DESCEND, and without poses CUT begin."""
    bridge_s: float = 0.18
    """For how long planned inputs are played when commands are late."""
    command_age_s: float = 0.2
    """A command computed from a pose that was captured longer ago is rejected, as are one of a frame further
    ahead of the raw poses, and one of an epoch that they left longer ago."""
    hold_limit_s: float = 0.5
    """Longest HOLD before LAND or DESCEND."""
    arm_low_s: float = 0.5
    low_thrust: float = 0.05
    """`arm_low_s`, `low_thrust`: commanded thrust must be at most `low_thrust` for `arm_low_s` before arming;
    the same applied thrust for the same time means that the vehicle stands on the floor."""
    disarm_after_s: float = 60.0
    """How long an armed vehicle may stand on the floor before it is disarmed."""
    lower: Four = (-1.0, -1.0, 0.0, -0.4)
    upper: Four = (1.0, 1.0, 1.0, 0.4)
    tolerance: float = 0.02
    """`lower`, `upper`, `tolerance`: input limits; a command further outside than `tolerance` is rejected."""
    descend_below_hover: float = 0.11
    descend_rate_per_s: float = 0.5
    """`descend_below_hover`, `descend_rate_per_s`: DESCEND lowers the thrust at this rate to this share below
    hover, and raises it again to 5 % below it as the vehicle is predicted to reach 0.8 m/s."""
    hover_correction: float = 0.35
    """Largest correction of the calibrated hover thrust from the flight; 0 for none."""
    take_over_s: float = 0.7
    """Longest silence on the serial line after which a restarted gateway takes over a flying vehicle; well
    under the time for which receivers hold their outputs."""
    floor_m: float = 0.0
    """Height at which vehicles stand, for one that was not seen standing."""
    airborne_m: float = 0.1
    """How far above that height a vehicle certainly flies."""
    fall_m_s: float = 0.9
    """Fastest fall that may follow where motors are switched off in the air: from 0.04 m at rest."""
    operators: frozenset[str] = frozenset({"operator"})
    """Names whose requests count as an operator's."""
    surveillance: SurveillanceLimits = SurveillanceLimits()
    """Limits judged from raw poses."""
    landing: LandingLimits = LandingLimits()
    """How the vehicle is held and landed while it is seen."""
    standing: StandingLimits | None = None
    """What is judged before arming; None for nothing."""
    lift_off: LiftOffLimits | None = None
    """How a lift-off is watched until the own pose has risen; None for not at all."""

    def below_hover(self, climb_m_s: float) -> float:
        """Share of the hover thrust that a descent without poses leaves out at a predicted climb rate."""
        begun = min(1.0 + climb_m_s / GENTLE_M_S, 1.0)
        return max(self.descend_below_hover * begun, min(self.descend_below_hover, GENTLE_SHARE))

    def descents_s(self, height_m: float) -> tuple[float, float]:
        """Descent without poses of a vehicle that was seen at this height over the floor last [s].

        Until it should have reached the floor, if the learned hover thrust is right, and the longest one.
        """
        least_s = self.cut_after_s - self.descend_after_s
        sinks_s = math.sqrt(2.0 * max(height_m, 0.0) / (self.below_hover(-GENTLE_M_S) * GRAVITY_M_S2))
        longest_s = min(SLOWER * sinks_s + DESCENT_BEGINS_S, LONGEST_DESCENT_S)
        return max(least_s, sinks_s), max(least_s, longest_s)

    def falls(self, height_m: float, climb_m_s: float) -> bool:
        """Whether a vehicle so high above the floor falls faster than `fall_m_s` without its motors."""
        return height_m > 0.0 and climb_m_s**2 + 2.0 * GRAVITY_M_S2 * height_m > self.fall_m_s**2

    @property
    def longest_shutdown_s(self) -> float:
        """Longest time from the request to shut down until the port may be closed."""
        return self.landing.longest_s + LONGEST_DESCENT_S + FAREWELL_S

    def __post_init__(self) -> None:
        others = ("lower", "upper", "tolerance", "hover_correction", "floor_m", "operators")
        _require_positive(self, "", (*others, "surveillance", "landing", "standing", "lift_off"))
        if not self.hold_after_s < self.descend_after_s < self.cut_after_s:
            raise LimitsError(
                f"descend_after_s: {self.descend_after_s} must lie between hold_after_s = {self.hold_after_s}"
                f" and cut_after_s = {self.cut_after_s}"
            )
        if not math.isfinite(self.floor_m):
            raise LimitsError(f"floor_m: {self.floor_m} must be a finite number")
        for name in ("tolerance", "hover_correction"):
            if not getattr(self, name) >= 0:
                raise LimitsError(f"{name}: {getattr(self, name)} must not be negative")
        for name, lower, upper in zip(
            ("pitch", "roll", "thrust", "yaw"), self.lower, self.upper, strict=True
        ):
            if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
                raise LimitsError(f"upper: {name} {upper} must be above its lower limit {lower}")
