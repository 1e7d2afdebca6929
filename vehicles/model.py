"""The model every vehicle type shares, as data.

Coaxial helicopters and quadrotors in attitude mode have the same structure seen from the sticks: every input
passes an actuator lag and then acts as an acceleration. They differ in numbers (`vehicles/types`)
and, in the simulator, in the tilt of their thrust.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any, Final, Literal, NamedTuple

import msgspec
import numpy as np

from rcopterx.tables import table_beside
from rcopterx.vehicles.state import GRAVITY_M_S2, INPUT_SIZE, U_THRUST, U_YAW, Array
from rcopterx.vehicles.tilt import TiltModel
from rcopterx.vehicles.tuples import Four, Three, Two

Seven = tuple[float, float, float, float, float, float, float]


class Departures(NamedTuple):
    """How far a true vehicle may be from its model in one loop."""

    gain_factor: float
    """The gain of a stick may be larger or smaller by this factor."""
    delay_s: float
    """The transport delay may be longer by this."""
    frequency_fraction: float
    """The frequency of the tilt, or of a lag's corner, may be off by this fraction."""

    def graded(self, identified: float, unidentified: float) -> float:
        """Value between that of identified and that of unidentified vehicles, geometric in the gain factor.

        `identified` holds at `IDENTIFIED_GAIN_FACTOR` and below it, `unidentified` at
        `UNIDENTIFIED_GAIN_FACTOR` and above it; both are positive.
        """
        share = (self.gain_factor - IDENTIFIED_GAIN_FACTOR) / (
            UNIDENTIFIED_GAIN_FACTOR - IDENTIFIED_GAIN_FACTOR
        )
        return float(identified * (unidentified / identified) ** min(max(share, 0.0), 1.0))

    @property
    def identified(self) -> bool:
        """Whether the gain is as certain as one that was fitted to a flight of the vehicle."""
        return self.gain_factor <= IDENTIFIED_GAIN_FACTOR


@dataclass(frozen=True)
class Uncertainty:
    """How far a true vehicle may be from its model, for the margins of controllers.

    Three-vectors are ordered horizontal, height, yaw. Raises `ValueError` for a number out of its range; the
    message begins with its name.
    """

    gain_factor: Three
    """The gain of a stick may be larger or smaller by this factor."""
    delay_s: Three
    """The transport delay may be longer by this."""
    frequency_fraction: Three
    """The frequency of the tilt, and of the corners of lags, may be off by this fraction."""
    tilt_damping: Two | None = None
    """Least and largest damping ratio that the tilt may have; None for that of the model."""
    without_tilt: Three | None = None
    """Gain factor, delay and frequency fraction of the horizontal motion where poses give no tilt; None for
    the same."""

    def __post_init__(self) -> None:
        if self.without_tilt is not None:
            self.for_positions_only()
        if not all(1.0 <= factor <= 4.0 for factor in self.gain_factor):
            raise ValueError(f"gain_factor: must be from 1 to 4, got {self.gain_factor}")
        if not all(0.0 <= delay_s <= 0.2 for delay_s in self.delay_s):
            raise ValueError(f"delay_s: must be from 0 to 0.2, got {self.delay_s}")
        if not all(0.0 <= fraction < 1.0 for fraction in self.frequency_fraction):
            raise ValueError(f"frequency_fraction: must be from 0 to below 1, got {self.frequency_fraction}")
        if self.tilt_damping is not None and not 0.0 < self.tilt_damping[0] <= self.tilt_damping[1] < 10.0:
            raise ValueError(
                f"tilt_damping: must be a least and a largest ratio between 0 and 10, got {self.tilt_damping}"
            )

    def for_positions_only(self) -> "Uncertainty":
        """Return the uncertainty where poses give no tilt."""
        gain_factor, delay_s, fraction = self.without_tilt or self.axes[0]
        return replace(
            self,
            gain_factor=(gain_factor, *self.gain_factor[1:]),
            delay_s=(delay_s, *self.delay_s[1:]),
            frequency_fraction=(fraction, *self.frequency_fraction[1:]),
            without_tilt=None,
        )

    @cached_property
    def axes(self) -> tuple[Departures, Departures, Departures, Departures]:
        """Departures of the axes x, y, z, yaw."""
        horizontal, height, yaw = map(Departures, self.gain_factor, self.delay_s, self.frequency_fraction)
        return horizontal, horizontal, height, yaw


_KNOWLEDGE: Final = msgspec.convert(table_beside(__file__, "uncertainties"), dict[str, Uncertainty])
UNIDENTIFIED: Final = _KNOWLEDGE["unidentified"]
"""A vehicle of which only the type is known."""
IDENTIFIED: Final = _KNOWLEDGE["identified"]
"""A vehicle whose model was fitted to its own flight."""
UNIDENTIFIED_GAIN_FACTOR, IDENTIFIED_GAIN_FACTOR = UNIDENTIFIED.gain_factor[0], IDENTIFIED.gain_factor[0]
DAMPING_FACTOR: Final = 1.25
"""Factor by which the damping ratio of its tilt may be off."""


def damping_range(ratio: float, factor: float = DAMPING_FACTOR) -> Two:
    """Return the least and the largest damping ratio that differ from one by a factor."""
    return ratio / factor, ratio * factor


CALM: Final = 0.01  # gust density of air at rest


class MotionModel(NamedTuple):
    """Parameters of the equations of motion (1) for kernels; vectors are body x, y, z, yaw, shape (4,)."""

    input_gain: Array
    damping: Array
    lag_s: Array
    gravity_m_s2: float
    thrust_coupling: float  # yaw stick per thrust stick that the rotors have not followed yet
    gyro: float  # yaw stick per yaw rate [s/rad]


@dataclass(frozen=True)
class Model:
    """Parameters of equation (1) with actuator lag and delay and the limits of one vehicle.

    Four-vectors are ordered pitch (body x), roll (body y), thrust (z), yaw. State limits bound x, y, z, xd_B,
    yd_B, zd_B, psid in this order; yaw itself is free. Raises `ValueError` for a parameter no vehicle can
    have; the message begins with its name.
    """

    kind: str
    """Name of the type of vehicle."""
    input_gain: Four
    """b_x, b_y, b_z [m/s^2 per unit], b_psi [rad/s^2 per unit]."""
    damping: Four
    """k_x, k_y, k_z, k_psi [1/s], negative for a stable vehicle; of motions slower than the lags."""
    lag_s: Four
    """First-order actuator lag of each input; with a tilt model those of pitch and roll are the equivalent
    for controllers that model nothing slower than a lag."""
    delay_s: float
    """Transport delay from a pose to the first effect of the command computed from it."""
    hover_thrust: float
    """Thrust input at which the vehicle was measured to hover."""
    input_min: Four
    """Lowest sticks."""
    input_max: Four
    """Highest sticks."""
    state_min: Seven
    """Lowest positions, velocities and yaw rate to plan with; positions are those of the volume."""
    state_max: Seven
    """Highest ones."""
    airframe: Literal["coaxial", "attitude", "lag"] = "lag"
    """What the vehicle is: a helicopter with two rotors and a stabilizer bar; one whose thrust tilts under a
    closed attitude loop; or one whose sticks act as accelerations after a lag, equation (1)."""
    gravity_m_s2: float = GRAVITY_M_S2
    """Gravity; where thrust is not proportional to its stick, as with a climb rate, the gain times the stick
    that keeps the height."""
    integrator_gain: float = 2.0
    """k_i of equation (1)."""
    yaw_gyro: bool = False
    """Whether a rate gyro damps the yaw: it corrects the yaw stick, so that its damping passes the yaw's lag
    instead of acting at once."""
    thrust_coupling: float = 0.0
    """Yaw stick per thrust stick that the rotors have not followed yet: of two rotors that turn against each
    other one is faster, and its torque comes first."""
    tilt: TiltModel | None = None
    """How pitch and roll sticks become acceleration; None for a first-order lag, `lag_s`."""
    sticks_known: bool = False
    """Whether a firmware reaches the tilt and the yaw rate that its settings give to full sticks, so that an
    identification keeps their gains."""
    uncertainty: Uncertainty = UNIDENTIFIED
    """How far the true vehicle may be from these numbers."""
    tilt_measured: bool = True
    """Whether its filter uses roll and pitch of poses: the setting `measured_tilt` of estimators."""
    gust_density: float = CALM
    """Random-walk density of the velocity [m/s per root second]: gusts too short to be compensated."""
    lever_arm_m: float = 0.0
    """Height of the origin of its subject above the centre of gravity, negative below it."""

    def for_positions_only(self) -> "Model":
        """Return the same model where poses give no tilt."""
        return replace(self, tilt_measured=False, uncertainty=self.uncertainty.for_positions_only())

    def within(self, low_m: Three, high_m: Three) -> "Model":
        """Return the same model with other bounds of the position."""
        low, high = self.state_min[3:], self.state_max[3:]
        return replace(self, state_min=(*low_m, *low), state_max=(*high_m, *high))

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            numbers = value if isinstance(value, tuple) else (value,) if isinstance(value, float) else ()
            if not all(map(math.isfinite, numbers)):
                raise ValueError(f"{field.name}: every number must be finite, got {value}")
        for name in ("input_gain", "gravity_m_s2", "gust_density"):
            if np.min(getattr(self, name)) <= 0:
                raise ValueError(f"{name}: must be above 0, got {getattr(self, name)}")
        for name in ("lag_s", "delay_s"):
            if np.min(getattr(self, name)) < 0:
                raise ValueError(f"{name}: must not be below 0, got {getattr(self, name)}")
        if (self.yaw_gyro or self.thrust_coupling) and not self.lag_s[U_YAW] > 0:
            raise ValueError(f"lag_s: a yaw of rotors needs a lag above 0, got {self.lag_s[U_YAW]}")
        for kind in ("input", "state"):
            low, high = getattr(self, f"{kind}_min"), getattr(self, f"{kind}_max")
            if not all(a < b for a, b in zip(low, high, strict=True)):
                raise ValueError(f"{kind}_max: {high} must be above {kind}_min = {low} everywhere")
        if min(self.input_min) < -1 or max(self.input_max) > 1:
            limits = f"{self.input_min} .. {self.input_max}"
            raise ValueError(f"input_max: inputs are normalised sticks from -1 to 1, got {limits}")
        if not (np.less(self.input_min, self.hover_input) & np.less(self.hover_input, self.input_max)).all():
            limits = f"{self.input_min} .. {self.input_max}"
            raise ValueError(f"input_max: {limits} must contain {self.hover_input}, which keeps it at rest")

    @cached_property
    def b(self) -> Array:
        """Input gains, shape (4,)."""
        return np.array(self.input_gain)

    @cached_property
    def k(self) -> Array:
        """Damping of motions slower than the lags, shape (4,)."""
        return np.array(self.damping)

    @cached_property
    def direct_damping(self) -> Four:
        """The part of the damping that acts at once, without passing a lag [1/s]."""
        k_x, k_y, k_z, k_yaw = self.damping
        return k_x, k_y, k_z, 0.0 if self.yaw_gyro else k_yaw

    @cached_property
    def rate_feedback(self) -> Four:
        """Amount that on-board electronics subtract from each stick per unit of velocity, ahead of the lag:
        the gyro [s/m, s/rad].
        """
        gyro = -self.damping[U_YAW] / self.input_gain[U_YAW] if self.yaw_gyro else 0.0
        return 0.0, 0.0, 0.0, gyro

    @cached_property
    def u_min(self) -> Array:
        """Lower input limits, shape (4,)."""
        return np.array(self.input_min)

    @cached_property
    def u_max(self) -> Array:
        """Upper input limits, shape (4,)."""
        return np.array(self.input_max)

    @cached_property
    def hover_input(self) -> Array:
        """Input that keeps the model at rest, shape (4,): gravity over b_z, zeros else."""
        hover = np.zeros(INPUT_SIZE)
        hover[U_THRUST] = self.gravity_m_s2 / self.input_gain[U_THRUST]
        return hover

    @cached_property
    def motion_model(self) -> MotionModel:
        """Parameters of the equations of motion for kernels."""
        direct, lag_s, gyro = np.array(self.direct_damping), np.array(self.lag_s), self.rate_feedback[U_YAW]
        return MotionModel(self.b, direct, lag_s, self.gravity_m_s2, self.thrust_coupling, gyro)

    @cached_property
    def stick_room(self) -> Array:
        """Smaller way of each stick from hovering to its limits, shape (4,)."""
        return np.minimum(self.u_max - self.hover_input, self.hover_input - self.u_min)

    @cached_property
    def reach(self) -> Array:
        """Accelerations either way from hovering: horizontal at any heading, vertical, of the heading."""
        reach = self.b * self.stick_room
        return np.array([reach[:2].min(), *reach[2:]])

    @cached_property
    def sure_reach(self) -> Array:
        """The same of the weakest vehicle that the model may stand for."""
        return np.asarray(self.reach / np.array(self.uncertainty.gain_factor))


FITTED: Final = (
    "input_gain", "gravity_m_s2", "damping", "lag_s", "delay_s", "hover_thrust", "thrust_coupling", "tilt",
    "uncertainty", "gust_density", "lever_arm_m",
)  # fmt: skip
"""Parameters that an identification finds."""

DIGITS: Final = 4  # significant ones of identified parameters, as they are written and sent


def fitted_parameters(model: Model) -> dict[str, Any]:
    """Return the fields of a model in `FITTED`, rounded to `DIGITS` significant digits."""
    # msgspec would leave out defaults of dataclasses that it has converted.
    plain = asdict(model)
    return {name: _rounded(plain[name]) for name in FITTED}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def with_parameters(model: Model, parameters: Mapping[str, Any]) -> Model:
    """Return a model with identified parameters; tables of `tilt` and `uncertainty` may be incomplete.

    Raises `ValueError`: a parameter that no identification finds, of the wrong type, or that no vehicle can
    have.
    """
    if not parameters:
        return model
    plain = asdict(model)
    for name, value in parameters.items():
        if name not in FITTED:
            raise ValueError(f"{name}: not among the identified parameters {', '.join(FITTED)}")
        known = plain[name]
        incomplete = isinstance(known, dict) and isinstance(value, Mapping)
        plain[name] = known | dict(value) if incomplete else value
    return msgspec.convert(plain, Model)
