"""Kernels of the equations of motion of a simulated helicopter (`rcopterx.simulator.helicopter_dynamics`)."""

import math
from typing import Final

import numpy as np

from rcopterx.compiling.compiled import COUNT, FLAG, NUMBER, VECTOR, Array, compiled, part, together
from rcopterx.native.turbulence import renewed

STATE_SIZE: Final = 20
PER_MASS = 0
DRAG = 1
PER_INERTIA = 3
GYRO = 6
DAMPING = 9
UPPER = 11
LOWER = 19
MIXER = 27
YAW_RATE_GAIN = 30
SERVO = 31
BAR = 33
GROUND = 34
GRAVITY = 36
"""Where the parameters of a vehicle are in an array: one over its mass, drag along body x and y, one over the
inertias, differences of inertias, damping of roll and pitch, eight numbers of each rotor (see below), the
mixer (determinant, force per thrust stick, moment per yaw rate), yaw rate per yaw stick, rates of the servos,
rate of the bar, strength of the ground effect and its rate with height, gravity."""
THRUST = 0
TORQUE = 1
RATE = 2
SLOPE = 3
PHASE = 4
LINK = 5
ARM = 6
SPRING = 7
"""Where the eight numbers of a rotor are after `UPPER` and `LOWER`: thrust and torque per squared speed, rate
of its lag, phase lag per speed and at rest, lean of the disc per lean of what it follows, distance of the hub
from the centre of mass, stiffness against tilting."""
_TINY = 1e-9
ENDURANCE = 0
SAG = 1
LOW = 2
HIGH = 5
KEEP = 8
GRID = 9
WORLD_SIZE: Final = 10
"""Where the conditions of a flight are in an array: how long the battery hovers and the thrust that it loses,
lowest and highest place of the flight volume, what is left of the turbulence after a step of its time grid,
and that step."""

State = tuple[float, ...]
Pair = tuple[float, float]
Four = tuple[float, float, float, float]
_STATE: Final = together(*STATE_SIZE * [NUMBER])
_PAIR: Final = together(*2 * [NUMBER])
_FOUR: Final = together(*4 * [NUMBER])


@part
def rotor(
    vehicle: Array, place: int, thrust_n: float, link: float, phase_rad: float, lean_x: float, lean_y: float
) -> tuple[float, float, float, float, float]:
    """Force, and moments about body x and y, of a rotor whose disc follows a lean, turned by its phase."""
    c, s = link * math.cos(phase_rad), link * math.sin(phase_rad)
    tilt_x, tilt_y = c * lean_x - s * lean_y, s * lean_x + c * lean_y
    tilt = math.hypot(tilt_x, tilt_y)
    lateral_n = thrust_n * math.sin(tilt) / tilt if tilt > _TINY else thrust_n
    lever = vehicle[place + ARM] * lateral_n + vehicle[place + SPRING]
    return lateral_n * tilt_x, lateral_n * tilt_y, thrust_n * math.cos(tilt), -lever * tilt_y, lever * tilt_x


@part
def speeds(vehicle: Array, thrust: float, yaw: float, yaw_rate_rad_s: float, battery: float) -> Pair:
    """Rotor speeds that the electronics ask for: thrust linear in the stick, yaw rate held by the gyro."""
    thrust_n = vehicle[MIXER + 1] * thrust
    torque_n_m = vehicle[MIXER + 2] * (vehicle[YAW_RATE_GAIN] * yaw - yaw_rate_rad_s)
    upper = (vehicle[LOWER + TORQUE] * thrust_n - vehicle[LOWER] * torque_n_m) / vehicle[MIXER]
    lower = (vehicle[UPPER + TORQUE] * thrust_n + vehicle[UPPER] * torque_n_m) / vehicle[MIXER]
    return math.sqrt(max(upper * battery, 0.0)), math.sqrt(max(lower * battery, 0.0))


@part
def ground_factor(vehicle: Array, height_m: float) -> float:
    """Thrust over that far above the floor."""
    factor: float = 1.0 + vehicle[GROUND] * math.exp(-max(height_m, 0.0) * vehicle[GROUND + 1])
    return factor


@part
def rates(
    vehicle: Array,
    state: Array,
    swash: Pair,
    running: bool,
    throttle: Pair,
    battery: float,
    weather: Four,
) -> Array:
    """Time derivative of the state, shape (20,)."""
    (
        _, _, z, vx, vy, vz, qw, qx, qy, qz, p, q, r,
        speed_u, speed_l, bar_x, bar_y, bar_z, swash_x, swash_y,
    ) = tuple_of(state)  # fmt: skip
    r00, r01, r02 = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)
    r10, r11, r12 = 2 * (qx * qy + qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx)
    r20, r21, r22 = 2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy)

    # Angle between mast and bar as a vector towards which the bar leans, in the body frame.
    lean_x = r00 * bar_x + r10 * bar_y + r20 * bar_z
    lean_y = r01 * bar_x + r11 * bar_y + r21 * bar_z
    cosine = r02 * bar_x + r12 * bar_y + r22 * bar_z
    sine = math.hypot(lean_x, lean_y)
    stretch = math.atan2(sine, cosine) / sine if sine > _TINY else 1.0
    relaxation = stretch * vehicle[BAR]

    ground = ground_factor(vehicle, z)
    force_x, force_y, force_z, moment_x, moment_y = rotor(
        vehicle, UPPER, ground * vehicle[UPPER] * speed_u * speed_u, vehicle[UPPER + LINK] * stretch,
        vehicle[UPPER + SLOPE] * speed_u + vehicle[UPPER + PHASE], lean_x, lean_y,
    )  # fmt: skip
    lower_x, lower_y, lower_z, moment_xl, moment_yl = rotor(
        vehicle, LOWER, ground * vehicle[LOWER] * speed_l * speed_l, vehicle[LOWER + LINK],
        -vehicle[LOWER + SLOPE] * speed_l - vehicle[LOWER + PHASE], swash_x, swash_y,
    )  # fmt: skip
    moment_z = vehicle[LOWER + TORQUE] * speed_l * speed_l - vehicle[UPPER + TORQUE] * speed_u * speed_u

    ax = (force_x + lower_x) * vehicle[PER_MASS] - vehicle[DRAG] * (r00 * vx + r10 * vy + r20 * vz)
    ay = (force_y + lower_y) * vehicle[PER_MASS] - vehicle[DRAG + 1] * (r01 * vx + r11 * vy + r21 * vz)
    az = (force_z + lower_z) * vehicle[PER_MASS]
    command_u, command_l = 0.0, 0.0
    if running:
        command_u, command_l = speeds(vehicle, throttle[0], throttle[1], r, battery)
    rate = np.empty(STATE_SIZE)
    rate[0] = vx
    rate[1] = vy
    rate[2] = vz
    rate[3] = r00 * ax + r01 * ay + r02 * az + weather[0]
    rate[4] = r10 * ax + r11 * ay + r12 * az + weather[1]
    rate[5] = r20 * ax + r21 * ay + r22 * az + weather[2] - vehicle[GRAVITY]
    rate[6] = -0.5 * (qx * p + qy * q + qz * r)
    rate[7] = 0.5 * (qw * p + qy * r - qz * q)
    rate[8] = 0.5 * (qw * q + qz * p - qx * r)
    rate[9] = 0.5 * (qw * r + qx * q - qy * p)
    rate[10] = vehicle[PER_INERTIA] * (moment_x + moment_xl + vehicle[GYRO] * q * r - vehicle[DAMPING] * p)
    rate[11] = vehicle[PER_INERTIA + 1] * (
        moment_y + moment_yl + vehicle[GYRO + 1] * r * p - vehicle[DAMPING + 1] * q
    )
    rate[12] = vehicle[PER_INERTIA + 2] * (moment_z + vehicle[GYRO + 2] * p * q) + weather[3]
    rate[13] = vehicle[UPPER + RATE] * (command_u - speed_u)
    rate[14] = vehicle[LOWER + RATE] * (command_l - speed_l)
    rate[15] = relaxation * (r02 - cosine * bar_x)
    rate[16] = relaxation * (r12 - cosine * bar_y)
    rate[17] = relaxation * (r22 - cosine * bar_z)
    rate[18] = vehicle[SERVO] * (swash[0] - swash_x)
    rate[19] = vehicle[SERVO + 1] * (swash[1] - swash_y)
    return rate


@part
def shorten_to_one(state: Array, begin: int, end: int) -> None:
    """Give some numbers of a state that belong together a length of 1 again."""
    total = 0.0
    for place in range(begin, end):
        total += state[place] * state[place]
    scale = 1.0 / math.sqrt(total)
    for place in range(begin, end):
        state[place] *= scale


@part
def moved(state: Array, rate: Array, time_s: float) -> Array:
    """State after some time at a constant rate."""
    after = np.empty(STATE_SIZE)
    for place in range(STATE_SIZE):
        after[place] = state[place] + time_s * rate[place]
    return after


@part
def stepped(
    vehicle: Array,
    start: Array,
    step_s: float,
    swash: Pair,
    running: bool,
    throttle: Pair,
    battery: float,
    weather: Four,
) -> Array:
    """State after one step of the explicit midpoint rule."""
    rate = rates(vehicle, start, swash, running, throttle, battery, weather)
    middle = moved(start, rate, 0.5 * step_s)
    rate = rates(vehicle, middle, swash, running, throttle, battery, weather)
    after = moved(start, rate, step_s)
    shorten_to_one(after, 6, 10)
    shorten_to_one(after, 15, 18)
    return after


@part
def turned(yaw_rad: float, w: float, x: float, y: float, z: float) -> float:
    """How far the heading of an attitude is from one that is not wrapped, the short way round."""
    angle = math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)) - yaw_rad
    # The remainder of the standard, to which `math.remainder` rounds: no kernel may call that one.
    size, circle = abs(angle), math.tau
    rest = size % circle
    left = circle - rest
    if rest > left:
        rest = -left
    elif rest == left:
        rest -= 2.0 * (0.5 * (size - rest) % circle)
    return math.copysign(1.0, angle) * rest


@part
def array_of(state: State) -> Array:
    """State as an array."""
    numbers = np.empty(STATE_SIZE)
    for place in range(STATE_SIZE):
        numbers[place] = state[place]
    return numbers


@part
def tuple_of(s: Array) -> State:
    """State as plain floats."""
    return (
        s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9],
        s[10], s[11], s[12], s[13], s[14], s[15], s[16], s[17], s[18], s[19],
    )  # fmt: skip


@compiled(VECTOR, NUMBER, NUMBER, NUMBER, NUMBER)
def helicopter_speeds(
    vehicle: Array, thrust: float, yaw: float, yaw_rate_rad_s: float, battery: float
) -> Pair:
    """Speeds of the upper and lower rotor that the electronics ask for [rad/s]; see `speeds`."""
    return speeds(vehicle, thrust, yaw, yaw_rate_rad_s, battery)


@compiled(VECTOR, NUMBER, NUMBER, NUMBER)
def helicopter_thrust(vehicle: Array, speed_upper: float, speed_lower: float, height_m: float) -> float:
    """Thrust of both rotors along their axes, ground effect included [N]."""
    squares: float = vehicle[UPPER] * speed_upper**2 + vehicle[LOWER] * speed_lower**2
    return ground_factor(vehicle, height_m) * squares


@compiled(VECTOR, _STATE, _PAIR, FLAG, _PAIR, NUMBER, _FOUR)
def helicopter_rates(
    vehicle: Array,
    state: State,
    swash: Pair,
    running: bool,
    throttle: Pair,
    battery: float,
    weather: Four,
) -> State:
    """Time derivative of the state, in the same order.

    Parameters
    ----------
    vehicle
        Parameters, shape (37,).
    state
        Twenty numbers, see `rcopterx.simulator.helicopter_dynamics.State`.
    swash
        Target of the swash plate.
    running
        Whether the motors run.
    throttle
        Thrust and yaw sticks, if they run.
    battery
        Thrust that the battery has left, as a fraction.
    weather
        Accelerations: inertial x, y, z [m/s^2], yaw [rad/s^2].
    """
    return tuple_of(rates(vehicle, array_of(state), swash, running, throttle, battery, weather))


@compiled(VECTOR, _STATE, NUMBER, _PAIR, FLAG, _PAIR, NUMBER, _FOUR)
def helicopter_step(
    vehicle: Array,
    state: State,
    step_s: float,
    swash: Pair,
    running: bool,
    throttle: Pair,
    battery: float,
    weather: Four,
) -> State:
    """State after one step of the explicit midpoint rule; see `helicopter_rates` for the arguments."""
    return tuple_of(stepped(vehicle, array_of(state), step_s, swash, running, throttle, battery, weather))


@compiled(
    VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, NUMBER, NUMBER, COUNT, NUMBER, NUMBER, NUMBER,
    NUMBER, COUNT, COUNT, _PAIR, FLAG, _PAIR,
)  # fmt: skip
def helicopter_flight(
    vehicle: Array, world: Array, state: Array, value: Array, renewal: Array, normals: Array,
    yaw_rad: float, time_s: float, step_s: float, steps: int, used_s: float, load: float, intact: float,
    downwash_m_s2: float, index: int, place: int, swash: Pair, running: bool, throttle: Pair,
) -> tuple[int, float, float, float, float, bool, bool, int, int]:  # fmt: skip
    """Fly on, until the floor is met or the normal numbers of the turbulence are used up.

    Parameters
    ----------
    vehicle
        Parameters, shape (37,).
    world
        Conditions, shape (10,).
    state
        See `rcopterx.simulator.helicopter_dynamics.State`, shape (20,); it is written.
    value, renewal, normals
        Turbulence: see `rcopterx.native.turbulence.turbulence_renewed`, four channels; the value is written.
    yaw_rad
        Heading, unwrapped.
    time_s
        Time flown so far.
    step_s, steps
        Length and number of steps of the midpoint rule.
    used_s
        Time of hovering that has been taken from the battery.
    load
        What is taken from it, of what hovering takes.
    intact
        Fraction of the thrust that faults have left.
    downwash_m_s2
        Downward acceleration.
    index, place
        Of the turbulence on its time grid, and of the next normal number.
    swash, running, throttle
        See `helicopter_rates`.

    Returns
    -------
    tuple
        Steps flown, time, yaw, time taken from the battery, fraction of the thrust that is left, whether the
        floor was met, whether the vehicle was outside the volume, and the new index and place.
    """
    done, landed, outside = 0, False, False
    battery = (1.0 - world[SAG] * min(used_s / world[ENDURANCE], 1.0)) * intact
    while done < steps and not landed:
        wanted = int((time_s + step_s / 2) / world[GRID])
        while index < wanted and place + len(value) <= len(normals):
            place = renewed(value, renewal, world[KEEP], normals, place)
            index += 1
        if index < wanted:
            break
        used_s += step_s * load
        battery = (1.0 - world[SAG] * min(used_s / world[ENDURANCE], 1.0)) * intact
        weather = value[0], value[1], value[2] - downwash_m_s2, value[3]
        after = stepped(vehicle, state, step_s, swash, running, throttle, battery, weather)
        for number in range(STATE_SIZE):
            state[number] = after[number]
        yaw_rad += turned(yaw_rad, state[6], state[7], state[8], state[9])
        landed = state[2] <= 0.0 and state[5] < 0.0
        for axis in range(3):
            if not world[LOW + axis] <= state[axis] <= world[HIGH + axis]:
                outside = True
        time_s += step_s
        done += 1
    return done, time_s, yaw_rad, used_s, battery, landed, outside, index, place
