"""Equations of motion of a coaxial helicopter with stabilizer bar (docs/helicopter.md), and their kernels.

Body frame: x forward, y left, z up along the mast. Rotations are right-handed: positive pitch is nose down
and accelerates forward, positive roll accelerates to the right (minus y). The upper rotor carries the bar,
the lower rotor the swash plate. All in SI units.
"""

import cmath
import math
from typing import Final, NamedTuple

from rcopterx.compiling.compiled import FLAG, NUMBER, compiled, part, record, together
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tuples import Four, Three

_TINY: Final = 1e-9
_LEAST_DRAG: Final = 0.1


Air = tuple[float, float, float, float, float, float]  # accelerations by the air, see `derivative`


class HelicopterState(NamedTuple):
    """State of a helicopter, or its time derivative."""

    x: float  # position and velocity in the inertial frame
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    qw: float  # attitude as a unit quaternion
    qx: float
    qy: float
    qz: float
    p: float  # rates of the body about its axes
    q: float
    r: float
    speed_upper: float  # speeds of the rotors
    speed_lower: float
    bar_x: float  # axis of the bar, a unit vector in the inertial frame
    bar_y: float
    bar_z: float
    swash_x: float  # tilt of the swash plate towards body x and y
    swash_y: float
    yaw_missed: float  # integral of the error of the yaw rate [rad]


class Rotor(NamedTuple):
    """Parameters of a rotor."""

    thrust: float  # thrust and drag torque over the square of the speed
    torque: float
    lag: float
    phase_per_speed: float  # phase lag: angle between the lean of the disc and the lean that it follows
    phase_at_rest: float
    link: float  # lean of the disc over the lean that it follows
    arm: float  # height above the centre of gravity
    spring: float  # moment of both blades per lean


class Airframe(NamedTuple):
    """Parameters of the equations of motion; see `HelicopterParameters`."""

    upper: Rotor
    lower: Rotor
    mass: float
    inertia_x: float
    inertia_y: float
    inertia_z: float
    drag_x: float
    drag_y: float
    flapping: float  # and of the tilt to the left of the one that resists airspeed
    flapping_across: float
    gust_speed: float  # speed of the wind over the horizontal acceleration that it causes
    damping_x: float
    damping_y: float
    bar_time_constant: float
    servo_lag_x: float
    servo_lag_y: float
    thrust_gain: float
    yaw_rate_gain: float
    yaw_gyro_gain: float
    ground_effect: float
    ground_effect_height: float
    yaw_hold: float


class Controls(NamedTuple):
    """Targets of the swash plate, whether the motors run, and the thrust and yaw sticks that they follow."""

    swash_x: float
    swash_y: float
    running: bool = False
    thrust: float = 0.0
    yaw: float = 0.0


_ROTOR: Final = record(Rotor, *8 * [NUMBER])
AIRFRAME: Final = record(Airframe, _ROTOR, _ROTOR, *20 * [NUMBER])
STATE: Final = record(HelicopterState, *21 * [NUMBER])
CONTROLS: Final = record(Controls, NUMBER, NUMBER, FLAG, NUMBER, NUMBER)
AIR: Final = together(*6 * [NUMBER])


def airframe_of(vehicle: HelicopterParameters) -> Airframe:
    """Parameters of the equations of motion of a vehicle."""
    by_rotor = zip(
        vehicle.thrust, vehicle.torque, vehicle.rotor_lag_s, vehicle.phase_per_speed_s,
        vehicle.phase_at_rest_rad, vehicle.link, vehicle.arm_m, vehicle.spring_n_m,
        strict=True,
    )  # fmt: skip
    upper, lower = (Rotor(*numbers) for numbers in by_rotor)
    flapping = cmath.rect(vehicle.flapping_rad_s_m, vehicle.flapping_phase_rad)
    return Airframe(
        upper, lower, vehicle.mass_kg, *vehicle.inertia_kg_m2, *vehicle.drag_per_s,
        flapping.real, flapping.imag, 2.0 / max(sum(vehicle.drag_per_s), _LEAST_DRAG), *vehicle.damping_n_m_s,
        vehicle.bar_time_constant_s, *vehicle.servo_lag_s, vehicle.thrust_gain_m_s2,
        vehicle.yaw_rate_gain_rad_s, vehicle.yaw_gyro_gain_per_s,
        vehicle.ground_effect, vehicle.ground_effect_height_m, vehicle.yaw_hold_per_s,
    )  # fmt: skip


def swash_target(parameters: HelicopterParameters, pitch: float, roll: float) -> tuple[float, float]:
    """Tilt of the swash plate towards body x and y that servo positions ask for, within its limit."""
    (gain_x, gain_y), (axis_x, axis_y) = parameters.swash_gain_rad, parameters.servo_axes_rad
    x = gain_x * pitch * math.cos(axis_x) - gain_y * roll * math.sin(axis_y)
    y = gain_x * pitch * math.sin(axis_x) + gain_y * roll * math.cos(axis_y)
    tilt, limit = math.hypot(x, y), parameters.swash_limit_rad
    return (x, y) if tilt <= limit else (x * limit / tilt, y * limit / tilt)


def level_state(position_m: Three, yaw_rad: float, speeds_rad_s: tuple[float, float]) -> HelicopterState:
    """State at rest: level, the bar upright, the swash plate neutral, the rotors at these speeds."""
    x, y, z = map(float, position_m)
    upper, lower = speeds_rad_s
    return HelicopterState(
        x, y, z, 0.0, 0.0, 0.0, math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2), 0.0, 0.0, 0.0,
        upper, lower, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


@compiled(AIRFRAME, NUMBER, NUMBER, NUMBER, NUMBER)
def commanded_speeds(
    airframe: Airframe, thrust: float, yaw: float, yaw_rate: float, thrust_factor: float
) -> tuple[float, float]:
    """Rotor speeds that the electronics command for what is left of the thrust; a gyro holds yaw rate."""
    upper, lower = airframe.upper, airframe.lower
    force = airframe.mass * airframe.thrust_gain * thrust
    moment = airframe.inertia_z * airframe.yaw_gyro_gain * (airframe.yaw_rate_gain * yaw - yaw_rate)
    determinant = upper.thrust * lower.torque + lower.thrust * upper.torque
    square_upper = (lower.torque * force - lower.thrust * moment) / determinant
    square_lower = (upper.torque * force + upper.thrust * moment) / determinant
    upper_speed = math.sqrt(max(square_upper * thrust_factor, 0.0))
    return upper_speed, math.sqrt(max(square_lower * thrust_factor, 0.0))


@compiled(AIRFRAME, NUMBER, NUMBER, NUMBER)
def rotor_thrusts(
    airframe: Airframe, speed_upper: float, speed_lower: float, height: float
) -> tuple[float, float]:
    """Thrust of each rotor along its axis, ground effect included."""
    ground = 1.0 + airframe.ground_effect * math.exp(-max(height, 0.0) / airframe.ground_effect_height)
    upper, lower = airframe.upper.thrust * speed_upper**2, airframe.lower.thrust * speed_lower**2
    return ground * upper, ground * lower


@part
def rotor_load(
    rotor: Rotor, thrust: float, phase: float, lean_x: float, lean_y: float
) -> tuple[float, float, float, float, float]:
    """Force, and moments about body x and y, of a rotor whose disc follows a lean."""
    c, s = rotor.link * math.cos(phase), rotor.link * math.sin(phase)
    tilt_x, tilt_y = c * lean_x - s * lean_y, s * lean_x + c * lean_y
    tilt = math.hypot(tilt_x, tilt_y)
    lateral = thrust * math.sin(tilt) / tilt if tilt > _TINY else thrust
    stiffness = rotor.arm * lateral + rotor.spring
    upward = thrust * math.cos(tilt)
    return lateral * tilt_x, lateral * tilt_y, upward, -stiffness * tilt_y, stiffness * tilt_x


@part
def rotation_matrix(
    s: HelicopterState,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Rotation from the body to the inertial frame, row by row."""
    qw, qx, qy, qz = s.qw, s.qx, s.qy, s.qz
    return (
        1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy),
        2 * (qx * qy + qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx),
        2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy),
    )  # fmt: skip


@part
def bar_lean(s: HelicopterState) -> Four:
    """Angle between mast and bar as a vector in the body plane, its cosine, and angle over sine."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(s)
    sine_x = r00 * s.bar_x + r10 * s.bar_y + r20 * s.bar_z
    sine_y = r01 * s.bar_x + r11 * s.bar_y + r21 * s.bar_z
    cosine = r02 * s.bar_x + r12 * s.bar_y + r22 * s.bar_z
    sine = math.hypot(sine_x, sine_y)
    stretch = math.atan2(sine, cosine) / sine if sine > _TINY else 1.0
    return stretch * sine_x, stretch * sine_y, cosine, stretch


@part
def rotor_loads(
    airframe: Airframe, state: HelicopterState, lean_x: float, lean_y: float
) -> tuple[float, float, float, float, float, float]:
    """Force and moment of both rotors in the body frame, with the bar leaning against the mast."""
    upper, lower = airframe.upper, airframe.lower
    speed_u, speed_l = state.speed_upper, state.speed_lower
    thrust_u, thrust_l = rotor_thrusts(airframe, speed_u, speed_l, state.z)
    phase_u = upper.phase_per_speed * speed_u + upper.phase_at_rest
    phase_l = -(lower.phase_per_speed * speed_l + lower.phase_at_rest)
    ux, uy, uz, moment_xu, moment_yu = rotor_load(upper, thrust_u, phase_u, lean_x, lean_y)
    lx, ly, lz, moment_xl, moment_yl = rotor_load(lower, thrust_l, phase_l, state.swash_x, state.swash_y)
    moment_z = lower.torque * speed_l * speed_l - upper.torque * speed_u * speed_u
    return ux + lx, uy + ly, uz + lz, moment_xu + moment_xl, moment_yu + moment_yl, moment_z


@compiled(AIRFRAME, STATE, CONTROLS, NUMBER, AIR)
def derivative(
    airframe: Airframe, state: HelicopterState, controls: Controls, thrust_factor: float, air: Air
) -> HelicopterState:
    """Time derivative of the state at a `thrust_factor`, in accelerations by the `air`, shape (6,)."""
    qw, qx, qy, qz, p, q, r = state.qw, state.qx, state.qy, state.qz, state.p, state.q, state.r
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(state)
    lean_x, lean_y, cosine, stretch = bar_lean(state)
    force_x, force_y, force_z, moment_x, moment_y, moment_z = rotor_loads(airframe, state, lean_x, lean_y)
    vx, vy, vz = state.vx, state.vy, state.vz
    ax = force_x / airframe.mass - airframe.drag_x * (r00 * vx + r10 * vy + r20 * vz)
    ay = force_y / airframe.mass - airframe.drag_y * (r01 * vx + r11 * vy + r21 * vz)
    az = force_z / airframe.mass
    # Airspeed makes the rotors flap, which tilts the vehicle against it.
    past_x, past_y = vx - airframe.gust_speed * air[0], vy - airframe.gust_speed * air[1]
    tilt_x = air[4] - airframe.flapping * past_x + airframe.flapping_across * past_y
    tilt_y = air[5] - airframe.flapping * past_y - airframe.flapping_across * past_x
    follow = stretch / airframe.bar_time_constant
    jx, jy, jz = airframe.inertia_x, airframe.inertia_y, airframe.inertia_z
    command_u, command_l, missed = 0.0, 0.0, 0.0
    if controls.running:
        held = r - airframe.yaw_hold * state.yaw_missed
        command_u, command_l = commanded_speeds(airframe, controls.thrust, controls.yaw, held, thrust_factor)
        missed = airframe.yaw_rate_gain * controls.yaw - r
    return HelicopterState(
        x=vx,
        y=vy,
        z=vz,
        vx=r00 * ax + r01 * ay + r02 * az + air[0],
        vy=r10 * ax + r11 * ay + r12 * az + air[1],
        vz=r20 * ax + r21 * ay + r22 * az + air[2] - GRAVITY_M_S2,
        qw=-0.5 * (qx * p + qy * q + qz * r),
        qx=0.5 * (qw * p + qy * r - qz * q),
        qy=0.5 * (qw * q + qz * p - qx * r),
        qz=0.5 * (qw * r + qx * q - qy * p),
        p=(moment_x + (jy - jz) * q * r - airframe.damping_x * p) / jx - (r01 * tilt_x + r11 * tilt_y),
        q=(moment_y + (jz - jx) * r * p - airframe.damping_y * q) / jy + (r00 * tilt_x + r10 * tilt_y),
        r=(moment_z + (jx - jy) * p * q) / jz + air[3],
        speed_upper=(command_u - state.speed_upper) / airframe.upper.lag,
        speed_lower=(command_l - state.speed_lower) / airframe.lower.lag,
        bar_x=follow * (r02 - cosine * state.bar_x),
        bar_y=follow * (r12 - cosine * state.bar_y),
        bar_z=follow * (r22 - cosine * state.bar_z),
        swash_x=(controls.swash_x - state.swash_x) / airframe.servo_lag_x,
        swash_y=(controls.swash_y - state.swash_y) / airframe.servo_lag_y,
        yaw_missed=missed,
    )


@part
def moved(state: HelicopterState, rate: HelicopterState, time_s: float) -> HelicopterState:
    """State after some time at a constant rate."""
    s, d, h = state, rate, time_s
    return HelicopterState(
        s.x + h * d.x, s.y + h * d.y, s.z + h * d.z, s.vx + h * d.vx, s.vy + h * d.vy, s.vz + h * d.vz,
        s.qw + h * d.qw, s.qx + h * d.qx, s.qy + h * d.qy, s.qz + h * d.qz,
        s.p + h * d.p, s.q + h * d.q, s.r + h * d.r,
        s.speed_upper + h * d.speed_upper, s.speed_lower + h * d.speed_lower,
        s.bar_x + h * d.bar_x, s.bar_y + h * d.bar_y, s.bar_z + h * d.bar_z,
        s.swash_x + h * d.swash_x, s.swash_y + h * d.swash_y, s.yaw_missed + h * d.yaw_missed,
    )  # fmt: skip


@part
def normalised(s: HelicopterState) -> HelicopterState:
    """State with quaternion and axis of the bar scaled to length 1."""
    n = 1.0 / math.sqrt(s.qw * s.qw + s.qx * s.qx + s.qy * s.qy + s.qz * s.qz)
    b = 1.0 / math.sqrt(s.bar_x * s.bar_x + s.bar_y * s.bar_y + s.bar_z * s.bar_z)
    return HelicopterState(
        s.x, s.y, s.z, s.vx, s.vy, s.vz, n * s.qw, n * s.qx, n * s.qy, n * s.qz, s.p, s.q, s.r,
        s.speed_upper, s.speed_lower, b * s.bar_x, b * s.bar_y, b * s.bar_z, s.swash_x, s.swash_y,
        s.yaw_missed,
    )  # fmt: skip


@compiled(AIRFRAME, STATE, CONTROLS, NUMBER, AIR, NUMBER)
def step(
    airframe: Airframe,
    state: HelicopterState,
    controls: Controls,
    thrust_factor: float,
    air: Air,
    step_s: float,
) -> HelicopterState:
    """State after a midpoint step of `derivative`; 4 ms cost the fast mode 5e-5 of its damping."""
    rate = derivative(airframe, state, controls, thrust_factor, air)
    middle = moved(state, rate, 0.5 * step_s)
    rate = derivative(airframe, middle, controls, thrust_factor, air)
    return normalised(moved(state, rate, step_s))
