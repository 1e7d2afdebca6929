"""How the pitch and roll sticks tilt a vehicle, and the acceleration that results (docs/helicopter.md).

Seen in the inertial frame, a rotor's tilt is a vector: the horizontal components of the body's upward axis.
Its dynamics do not prefer any direction, so the heading enters at one place only: the sticks are given in the
body frame. A *demand* e [m/s^2] is the stick times its gain b, turned into the inertial frame, after the
servo's lag; a model of this module gives the acceleration a:

    core' = A core + B e + E (w - v),    a = C core + D e,    tilt = S core

with the velocities w of the air and v of the vehicle, as airspeed makes rotors flap, and a steady gain of
one from demand to acceleration in still air, before the stabilizer bar follows the mast. A vehicle without a
tilt model answers by a first-order lag, as equation (1) of the paper assumes.
"""

import math
from dataclasses import dataclass, fields

import numpy as np

from rcopterx.vehicles.state import GRAVITY_M_S2, Array, heading_matrix


@dataclass(frozen=True, slots=True)
class TiltDynamics:
    """Continuous dynamics from demand to acceleration, inertial frame; n core states.

    Matrices a, b, c, d have the shapes (n, n), (n, 2), (2, n), (2, 2). The first two core states are the
    tilt; `rate` are the indices of its rates, which the air accelerates by `flapping` times its velocity past
    the vehicle.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    rate: slice
    flapping: float

    @property
    def size(self) -> int:
        """Number of core states n."""
        return len(self.a)


@dataclass(frozen=True)
class TiltModel:
    """A tilt that answers the stick as a damped oscillator, and the stabilizer bar of a coaxial helicopter.

    Without a bar the whole rotor tilts with the body, as under the attitude loop of a quadrotor. With one,
    the swash plate tilts the lower rotor, which tilts the body; the bar keeps its direction and pulls the
    body back by the upper rotor: an oscillator with hardly any damping of its own. Slowly the bar follows the
    mast, so that a constant stick makes the tilt creep. Phase lags of the rotors turn the directions and
    couple the axes. Raises `ValueError` for a parameter no vehicle can have; the message begins with its
    name.
    """

    frequency_rad_s: float
    """Natural frequency; with a bar that of the fast mode, sqrt(K_b / I)."""
    damping_ratio: float
    """Of that mode."""
    servo_lag_s: float = 0.02
    """First-order lag from the stick to the demand."""
    bar_time_constant_s: float | None = None
    """T_bar, with which the bar follows the mast; None for no bar."""
    upper_phase_rad: float = 0.0
    """zeta_u: the upper rotor's thrust is turned by it against the bar."""
    lower_phase_rad: float = 0.0
    """zeta_l: the lower rotor's thrust is turned back by it against the swash plate."""
    upper_share: float = 0.0
    """T_u l_u / (m g): the part of the thrust that follows the bar instead of the body."""
    direct_m: float = 0.0
    """Acceleration by the tilted lower rotor itself over the angular acceleration it causes
    [m/s^2 per rad/s^2]: T_l I / (m (T_l d_l + 2 k_sl))."""
    flapping_rad_s_m: float = 0.0
    """M_u: angular acceleration by which airspeed tilts the vehicle back [rad/s^2 per m/s]."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            if not math.isfinite(value):
                raise ValueError(f"{field.name}: must be finite, got {value}")
            if field.name not in ("upper_phase_rad", "lower_phase_rad") and value < 0.0:
                raise ValueError(f"{field.name}: must not be below 0, got {value}")
        for name in ("frequency_rad_s", "damping_ratio", "servo_lag_s", "bar_time_constant_s"):
            if getattr(self, name) == 0.0:
                raise ValueError(f"{name}: must be above 0, got 0")
        if self.upper_share >= 1.0:
            raise ValueError(f"upper_share: must be below 1, got {self.upper_share}")

    @property
    def flapping_drag_per_s(self) -> float:
        """Deceleration per airspeed by the tilt that flapping causes, before the bar follows [1/s]."""
        share = math.cos(self.upper_phase_rad) - self.upper_share
        return GRAVITY_M_S2 * share * self.flapping_rad_s_m / self.frequency_rad_s**2

    @property
    def coupling_rad(self) -> float:
        """Angle by which an acceleration is turned against the demand that causes it, before the bar
        follows.
        """
        plateau = self._plateau()
        return math.atan2(plateau[1, 0], plateau[0, 0])

    def _plateau(self) -> Array:
        """Return the acceleration of a still bar per angular acceleration, times the lower rotor's turn."""
        w, upper = self.frequency_rad_s, heading_matrix(self.upper_phase_rad)
        body = GRAVITY_M_S2 * (upper.T - self.upper_share * np.eye(2)) / w**2 + self.direct_m * np.eye(2)
        return np.asarray(body @ heading_matrix(-self.lower_phase_rad))

    def dynamics(self) -> TiltDynamics:
        """Continuous dynamics of the core: tilt (2), its rate (2) and, with a bar, its direction (2)."""
        w, eye, none = self.frequency_rad_s, np.eye(2), np.zeros((2, 2))
        upper, lower = heading_matrix(self.upper_phase_rad), heading_matrix(-self.lower_phase_rad)
        pull, damping = w**2 * upper, 2 * self.damping_ratio * w * eye
        hanging = GRAVITY_M_S2 * self.upper_share * upper
        # angular acceleration per demand, so that the steady acceleration of a still bar is one
        lever = lower / math.sqrt(np.linalg.det(self._plateau()))
        a = np.block([[none, eye], [-pull, -damping]])
        b = np.vstack((none, lever))
        c = np.hstack((GRAVITY_M_S2 * eye - hanging, none))
        if self.bar_time_constant_s is not None:
            following = eye / self.bar_time_constant_s
            a = np.block([[a, np.vstack((none, pull))], [following, none, -following]])
            b, c = np.vstack((b, none)), np.hstack((c, hanging))
        return TiltDynamics(a, b, c, self.direct_m * lever, slice(2, 4), self.flapping_rad_s_m)
