"""Parameters of a coaxial helicopter with stabilizer bar: the nominal vehicle, and a family drawn around it.

Structure and the figures of the CoaX: P. Fankhauser, S. Bouabdallah, S. Leutenegger, R. Siegwart,
"Modeling and Decoupling Control of the CoaX Micro Helicopter", IROS 2011, and the parameter list of the
Skybotix CoaX. Smaller vehicles follow by dynamic similarity: with the time scale s, lengths go with s^2,
masses with s^6, rotor speeds with 1/s, and accelerations stay as they are. The gains of the sticks are the
Blade mCX2's.
"""

import cmath
import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Self

import numpy as np

from rcopterx.vehicles.state import GRAVITY_M_S2

NOMINAL_SIZE: Final = 0.75  # time scale of the mCX2 against the CoaX
NOMINAL_PLATEAU_M_S2: Final = (2.0, 2.1)  # per unit of pitch and roll stick, before the bar creeps
NOMINAL_FLAPPING_RAD_S_M: Final = 5.0  # tilting by airspeed at the mCX2's size, like 0.29 /s more drag
ROTOR_RADIUS_M: Final = 0.17  # of the CoaX
DEGREE: Final = math.pi / 180


class Rotors(NamedTuple):
    """A parameter of both rotors."""

    upper: float
    lower: float


@dataclass(frozen=True, kw_only=True)
class HelicopterParameters:
    """Parameters of one helicopter; SI units, sticks as fractions of full stick.

    Defaults are those of the middle of the family, of any size.
    """

    size: float  # time scale against the CoaX; the other numbers are those of this size
    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]
    arm_m: Rotors  # height above the centre of gravity
    link: Rotors  # tilt of the disc per tilt of the bar against the mast, and of the swash plate
    spring_n_m: Rotors  # stiffness of both blades against flapping [N m/rad]
    bar_time_constant_s: float
    thrust: Rotors  # thrust over the square of the rotor speed [N s^2/rad^2]
    torque: Rotors  # drag torque over the square of the rotor speed [N m s^2/rad^2]
    rotor_lag_s: Rotors
    phase_per_speed_s: Rotors  # slope of the phase lag over the rotor speed
    phase_at_rest_rad: Rotors
    swash_limit_rad: float = 15 * DEGREE
    swash_gain_rad: tuple[float, float] = (1.0, 1.0)  # swash plate tilt per unit of pitch and roll stick
    thrust_gain_m_s2: float = 18.0  # thrust over mass per stick with a full battery, away from the floor
    yaw_rate_gain_rad_s: float = 22.2  # yaw rate that the gyro holds per unit of yaw stick
    yaw_gyro_gain_per_s: float  # yaw acceleration that the gyro asks for per error of the yaw rate
    drag_per_s: tuple[float, float] = (0.5, 0.4)  # translational drag over mass along body x and y, positive
    flapping_rad_s_m: float  # tilting back by airspeed [rad/s^2 per m/s]: the rotors flap
    flapping_phase_rad: float = 0.0  # direction of that tilt against the airspeed's, to the left
    added_damping: float = 0.3  # aerodynamic damping of pitch and roll as a damping ratio of the fast mode
    servo_lag_s: tuple[float, float] = (0.03, 0.03)  # first-order lags of the pitch and roll servos
    servo_step: float = 1 / 200  # resolution of the servos and half-width of their dead band
    trim: tuple[float, float, float, float] = (0.015, -0.015, 0.0, 0.01)  # offset of every stick
    marker_roll_rad: float = -1.75 * DEGREE  # rotation of the markers against the body, about body x
    marker_pitch_rad: float = 1.75 * DEGREE
    ground_effect: float = 0.075  # fraction by which the thrust is larger on the floor
    ground_effect_height_m: float = 0.1  # height over which the ground effect decays by e
    yaw_hold_per_s: float = 0.0  # yaw rate that the gyro asks for per turn that it missed: heading hold
    servo_axes_rad: tuple[float, float] = (0.0, 0.0)  # turn of the pitch and roll servos' axes to the left
    delay_s: float | None = None  # transport delay; None for that of the vehicle's type

    @classmethod
    def nominal(cls, size: float = NOMINAL_SIZE) -> Self:
        """Middle of the family, with the gains `NOMINAL_PLATEAU_M_S2`, at a time scale; half of its trims."""
        length, mass = size**2, size**6
        vehicle = cls(
            size=size,
            mass_kg=0.302 * mass,
            inertia_kg_m2=(
                1.837e-3 * mass * length**2,
                1.870e-3 * mass * length**2,
                2.7786e-4 * mass * length**2,
            ),
            arm_m=Rotors(0.165 * length, 0.103 * length),
            link=Rotors(0.6130, 0.5176),
            spring_n_m=Rotors(2 * 0.0542 * mass * length, 2 * 0.2139 * mass * length),
            bar_time_constant_s=1.6 * size,
            thrust=Rotors(2.2607e-5 * mass * size**2, 3.1531e-5 * mass * size**2),
            torque=Rotors(9.9708e-7 * mass * length * size**2, 8.9737e-7 * mass * length * size**2),
            rotor_lag_s=Rotors(0.185 * size, 0.115 * size),
            phase_per_speed_s=Rotors(-0.001282 * size, 0.001282 * size),
            phase_at_rest_rad=Rotors(0.1789, -0.0094),
            yaw_gyro_gain_per_s=5.0 * NOMINAL_SIZE / size,
            flapping_rad_s_m=NOMINAL_FLAPPING_RAD_S_M * (NOMINAL_SIZE / size) ** 3,
        )
        return vehicle.rigged(NOMINAL_PLATEAU_M_S2)

    @classmethod
    def drawn(cls, generator: np.random.Generator, size: float | None = None) -> Self:
        """One vehicle of the family, or of its members of a size.

        Size 0.6 to 1, added damping 0.1 to 0.5, servos 20 to 40 ms, trim up to 0.03, markers tilted by up to
        5 degrees, ground effect 5 to 10 %. Around the nominal vehicle of that size: arms and links 5 %,
        inertia, springs, thrust and torque coefficients and thrust gain 10 %, lags, bar, gyro and the stick's
        gains 15 %, drag and flapping 25 %, phase lags 0.06 rad. All uniform.
        """

        def within(low: float, high: float) -> float:
            return float(generator.uniform(low, high))

        def spread(value: float, fraction: float) -> float:
            return value * within(1 - fraction, 1 + fraction)

        def both(rotors: Rotors, fraction: float) -> Rotors:
            return Rotors(spread(rotors.upper, fraction), spread(rotors.lower, fraction))

        middle = cls.nominal(within(0.6, 1.0) if size is None else size)
        inertia_x, inertia_y, inertia_z = (spread(inertia, 0.10) for inertia in middle.inertia_kg_m2)
        trim_pitch, trim_roll, trim_yaw = (within(-0.03, 0.03) for _ in range(3))
        tilt_rad, direction_rad = within(0.0, 5.0) * DEGREE, within(-math.pi, math.pi)
        vehicle = replace(
            middle,
            inertia_kg_m2=(inertia_x, inertia_y, inertia_z),
            arm_m=both(middle.arm_m, 0.05),
            link=both(middle.link, 0.05),
            spring_n_m=both(middle.spring_n_m, 0.10),
            bar_time_constant_s=spread(middle.bar_time_constant_s, 0.15),
            thrust=both(middle.thrust, 0.10),
            torque=both(middle.torque, 0.10),
            rotor_lag_s=both(middle.rotor_lag_s, 0.15),
            phase_at_rest_rad=Rotors(*(phase + within(-0.06, 0.06) for phase in middle.phase_at_rest_rad)),
            thrust_gain_m_s2=spread(middle.thrust_gain_m_s2, 0.10),
            yaw_rate_gain_rad_s=spread(middle.yaw_rate_gain_rad_s, 0.15),
            yaw_gyro_gain_per_s=spread(middle.yaw_gyro_gain_per_s, 0.15),
            drag_per_s=(spread(middle.drag_per_s[0], 0.25), spread(middle.drag_per_s[1], 0.25)),
            added_damping=within(0.1, 0.5),
            servo_lag_s=(within(0.02, 0.04), within(0.02, 0.04)),
            trim=(trim_pitch, trim_roll, 0.0, trim_yaw),
            marker_roll_rad=tilt_rad * math.cos(direction_rad),
            marker_pitch_rad=tilt_rad * math.sin(direction_rad),
            ground_effect=within(0.05, 0.10),
        )
        pitch, roll = NOMINAL_PLATEAU_M_S2
        rigged = vehicle.rigged((spread(pitch, 0.15), spread(roll, 0.15)))
        return replace(rigged, flapping_rad_s_m=spread(middle.flapping_rad_s_m, 0.25))

    @classmethod
    def drawn_coax(cls, generator: np.random.Generator) -> Self:
        """One vehicle around the Skybotix CoaX that flew (docs/helicopter.md).

        Of size 1, but with a fast mode of 9 to 10.5 rad/s, added damping 0.3 to 0.5, servos whose tilts are
        turned by -15 to -40 degrees each, phases of the rotors included, flapping of 6.2 to 10.4 rad/s^2 per
        m/s, turned by -32 to -52 degrees, and a delay of 10 to 60 ms. All uniform.
        """
        vehicle, within = cls.drawn(generator, 1.0), generator.uniform
        slower = (vehicle.fast_mode_rad_s / within(9.0, 10.5)) ** 2
        roll, pitch, yaw = vehicle.inertia_kg_m2
        turned_rad = vehicle.hover_phases_rad.lower
        return replace(
            vehicle,
            inertia_kg_m2=(slower * roll, slower * pitch, yaw),
            added_damping=within(0.3, 0.5),
            servo_axes_rad=(turned_rad + within(-40, -15) * DEGREE, turned_rad + within(-40, -15) * DEGREE),
            flapping_rad_s_m=within(6.2, 10.4),
            flapping_phase_rad=within(-52, -32) * DEGREE,
            delay_s=within(0.01, 0.06),
        )

    def rigged(self, plateau_m_s2: tuple[float, float]) -> Self:
        """Copy whose swash plate linkage gives the pitch and roll sticks these plateaus [m/s^2 per unit]."""
        per_radian = self.plateau_per_swash.real
        return replace(self, swash_gain_rad=(plateau_m_s2[0] / per_radian, plateau_m_s2[1] / per_radian))

    @property
    def hover_speeds_rad_s(self) -> Rotors:
        """Speeds at which thrust is weight and the drag torques cancel."""
        ratio = self.torque.upper / self.torque.lower
        upper = self.mass_kg * GRAVITY_M_S2 / (self.thrust.upper + ratio * self.thrust.lower)
        return Rotors(math.sqrt(upper), math.sqrt(ratio * upper))

    @property
    def hover_thrusts_n(self) -> Rotors:
        """Thrusts in hover."""
        upper, lower = self.hover_speeds_rad_s
        return Rotors(self.thrust.upper * upper**2, self.thrust.lower * lower**2)

    @property
    def hover_phases_rad(self) -> Rotors:
        """Phase lags in hover."""
        parts = zip(self.phase_per_speed_s, self.hover_speeds_rad_s, self.phase_at_rest_rad, strict=True)
        return Rotors(*(slope * speed + at_rest for slope, speed, at_rest in parts))

    @property
    def bar_stiffness_n_m(self) -> float:
        """K_b: moment per angle between mast and bar in hover."""
        return self.link.upper * (self.hover_thrusts_n.upper * self.arm_m.upper + self.spring_n_m.upper)

    @property
    def swash_moment_n_m(self) -> float:
        """M_d: moment per tilt of the swash plate in hover."""
        return self.link.lower * (self.hover_thrusts_n.lower * self.arm_m.lower + self.spring_n_m.lower)

    @property
    def fast_mode_rad_s(self) -> float:
        """Natural frequency sqrt(K_b / I) of the body against its bar, of the mean of roll and pitch."""
        inertia = (self.inertia_kg_m2[0] + self.inertia_kg_m2[1]) / 2
        return math.sqrt(self.bar_stiffness_n_m / inertia)

    @property
    def tilt_per_slope(self) -> float:
        """Angular acceleration by a downwash that grows across the discs: m R^2 / (4 I), R of the size."""
        radius_m = ROTOR_RADIUS_M * self.size**2
        return self.mass_kg * radius_m**2 / (2 * (self.inertia_kg_m2[0] + self.inertia_kg_m2[1]))

    @property
    def damping_n_m_s(self) -> tuple[float, float]:
        """Added moments per roll and pitch rate."""
        roll, pitch, _ = self.inertia_kg_m2
        per_inertia = 2 * self.added_damping * math.sqrt(self.bar_stiffness_n_m)
        return per_inertia * math.sqrt(roll), per_inertia * math.sqrt(pitch)

    @property
    def plateau_per_swash(self) -> complex:
        """Acceleration [m/s^2] per swash plate tilt [rad] after the fast mode settles, before the bar moves.

        Forward and left as real and imaginary part for a forward tilt; the imaginary part is the coupling of
        the axes. A tilt to the left gives the same, turned by 90 degrees.
        """
        thrust_n, phase_rad = self.hover_thrusts_n, self.hover_phases_rad
        tilt = cmath.rect(self.swash_moment_n_m / self.bar_stiffness_n_m, -phase_rad.lower - phase_rad.upper)
        lower = thrust_n.lower * self.link.lower * cmath.exp(-1j * phase_rad.lower)
        upper = thrust_n.upper * self.link.upper * cmath.exp(1j * phase_rad.upper) * tilt
        return GRAVITY_M_S2 * tilt + (lower - upper) / self.mass_kg
