"""Kernels that watch a flight.

One counts half-waves of sticks and tilt (`rcopterx.agents.flight.oscillation`), one compares what sticks
asked for with what the vehicle did (`rcopterx.agents.flight.vehicle_watch`).
"""

import math

from rcopterx.compiling.compiled import ANY_VECTOR, COUNT, MATRIX, NUMBER, VECTOR, Array, compiled, part
from rcopterx.native.motion import THRUST, TURN

SHORTEST_HALF_WAVE_S = 0.1
LONGEST_HALF_WAVE_S = 0.8
SMOOTHING_S = 0.02
ALIKE = 2.0
"""Largest ratio of the lengths of two half-waves to the same side of one oscillation."""
FADING = 0.85
"""Smallest ratio of their sizes; what fades faster ends by itself."""
NEAR_M = 0.4
NEAR_RAD = 0.8
"""Distance from the reference that is near."""
RESTING_M_S = 0.05
"""A reference slower than this rests."""

SIGNALS = 6
"""Four sticks and both components of the tilt."""
REST = 0
THRESHOLD = 1
NEEDED_NEAR = 2
NEEDED = 3
LIMITS = 4
"""What a channel is told: the signal at rest, how far from it a half-wave is at least, and how many of them
in a row are an oscillation, near the reference and anywhere."""
AWAY = 0
SINCE_S = 1
SIZE = 2
SIDE = 3
WAVES = 4
WAVES_NEAR = 5
OLDER_S = 6
OLDER_SIZE = 7
LAST_S = 8
LAST_SIZE = 9
CHANNEL = 10
"""What a channel knows: the smoothed signal less its rest; of the half-wave that goes on, its age, its size
and its side, 0 before the first one; half-waves in a row, anywhere and near the reference; length and size of
the last but one and of the last, lengths of 0 for none."""
RESTED = 3
"""Where beside the last place of the reference it is kept whether it rested."""

DEAD_EFFECT = 0.15
"""An axis with less than this has none."""
AXIS_PATIENCE_S = 0.3
"""How long windows have to agree about an axis."""
SWING_S = 2.5
"""A stick that was as far on the other side so shortly before swings."""
MOST_TURNED_RAD = 0.5
"""A rotor's tilt stays behind the heading, so windows that turn further say nothing of pitch and roll."""
THRUST_WINDOW_S = 1.0
LEAST_CLIMB_M = 0.1
"""Height that full thrust gains within its window at least."""
LEARNING_S = 3.0
"""First seconds of a flight, in which its thrust gain is learnt."""
LEAST_GAIN = 0.7
"""Share of the learnt thrust gain below which the rotor counts as weak..."""
SUDDEN = 0.9
"""...if it is also less than this share of the gain of the last seconds: a battery takes its time."""
BATTERY_TIME_S = 5.0
"""Time constant of the hover thrust, which a battery changes slowly."""

DOES_AS_TOLD = 1.0
"""Effect of an axis that does what the model says, and of one of which nothing can be told."""
SOUND = 0
THRUST_EXHAUSTED = 1
THRUST_LOST = 2
BATTERY_EMPTY = 3
AXIS_AT_FAULT = 4
"""What is found: nothing, a rotor without climb at full thrust, one that has become weak, one that needs too
much of its thrust to hover, or from `AXIS_AT_FAULT` on the pitch, roll or yaw stick."""

FULL_THRUST = 0
HOVER_GAIN = 1
LAND_AT = 2
RULES = 3
"""What of a vehicle is to be told: thrust that counts as its limit, hover thrust of the model as a share of
the largest one, and the share at which the battery counts as empty."""
SUSPECT_S = 0
FULL_FOR_S = 3
HOVER_THRUST = 4
LEARNT_GAIN = 5
LEARNING_FOR_S = 6
GAIN = 7
EFFECT = 8
KNOWN = 11
"""What is known of a vehicle: for how long pitch, roll and yaw have had no effect, and how long the thrust
has been full; share of the largest thrust that carries it, filtered, and the gain of its thrust over that of
the model, learnt first, nan until they are known; how long it was learnt, and the newest gain; and the newest
effects of pitch, roll and yaw."""


@part
def _alike(channel: Array) -> bool:
    """Whether the half-wave that ends is like the last one to its side."""
    lasted_s, since_s = channel[OLDER_S], channel[SINCE_S]
    if lasted_s == 0.0:
        return True
    longer = max(lasted_s, since_s) / min(lasted_s, since_s)
    return bool(longer <= ALIKE and channel[SIZE] >= FADING * channel[OLDER_SIZE])


@part
def _begin(channel: Array, side: float) -> None:
    """Count a half-wave that begins, and thereby the one before it that ends."""
    since_s = channel[SINCE_S]
    follows = channel[SIDE] != 0.0 and SHORTEST_HALF_WAVE_S <= since_s <= LONGEST_HALF_WAVE_S
    if not follows:
        channel[WAVES] = 1.0
    elif _alike(channel):
        channel[WAVES] += 1.0
    else:
        # An oscillation that begins, or is disturbed, has some that are unlike.
        channel[WAVES] = max(channel[WAVES] - 1.0, 1.0)
    channel[WAVES_NEAR] = min(channel[WAVES_NEAR] + 1.0, channel[WAVES])
    channel[OLDER_S], channel[OLDER_SIZE] = channel[LAST_S], channel[LAST_SIZE]
    channel[LAST_S] = since_s if follows else 0.0
    channel[LAST_SIZE] = channel[SIZE] if follows else 0.0
    channel[SIDE], channel[SINCE_S], channel[SIZE] = side, 0.0, 0.0


@part
def _observe(channel: Array, limits: Array, value: float, near: bool, period_s: float) -> bool:
    """Take in a control period of one signal; whether an oscillation begins another half-wave."""
    away = channel[AWAY]
    away += period_s / (period_s + SMOOTHING_S) * (value - limits[REST] - away)
    size = abs(away)
    channel[AWAY] = away
    channel[SINCE_S] += period_s
    begins = False
    if size > limits[THRESHOLD]:
        side = 1.0 if away > 0.0 else -1.0
        begins = side != channel[SIDE]
        if begins:
            _begin(channel, side)
    channel[SIZE] = max(channel[SIZE], size)
    if channel[SINCE_S] > LONGEST_HALF_WAVE_S:
        channel[WAVES] = channel[WAVES_NEAR] = 0.0
    if not near:
        channel[WAVES_NEAR] = 0.0
    enough = channel[WAVES_NEAR] >= limits[NEEDED_NEAR] or channel[WAVES] >= limits[NEEDED]
    return begins and bool(enough)


@compiled(MATRIX, MATRIX, VECTOR, *4 * [ANY_VECTOR], NUMBER)
def observe_swings(
    channels: Array,
    limits: Array,
    place: Array,
    stick: Array,
    tilt: Array,
    motion: Array,
    reference: Array,
    period_s: float,
) -> int:
    """Count half-waves of the sticks and of the tilt in a control period.

    Parameters
    ----------
    channels
        See `CHANNEL`, changed in place, shape (2 `SIGNALS`, `CHANNEL`). The second half, of smaller
        half-waves, counts while the reference rests and forgets what it knows when that ends.
    limits
        See `LIMITS`, shape (2 `SIGNALS`, `LIMITS`).
    place
        Of the last reference, and whether it rested, changed in place, shape (4,); nan for none.
    stick
        Command, shape (4,).
    tilt
        Horizontal components of the body's upward axis, the first two entries; empty where not known.
    motion
        Estimated motion state, shape (8,).
    reference
        Where the vehicle is to be: x, y, z [m], yaw [rad], shape (4,).
    period_s
        Time since the last one.

    Returns
    -------
    int
        A bit for each channel, from the lowest one on: whether its oscillation begins another half-wave.
    """
    resting, away = True, 0.0
    for axis in range(3):
        resting = resting and abs(reference[axis] - place[axis]) < RESTING_M_S * period_s
        place[axis] = reference[axis]
        away += (motion[axis] - reference[axis]) ** 2
    near = math.sqrt(away) < NEAR_M and abs(motion[3] - reference[3]) < NEAR_RAD
    if place[RESTED] > 0.0 and not resting:
        for number in range(SIGNALS, 2 * SIGNALS):
            for entry in range(CHANNEL):
                channels[number, entry] = 0.0
    place[RESTED] = 1.0 if resting else 0.0
    found = 0
    for number in range(2 * SIGNALS if resting else SIGNALS):
        signal = number % SIGNALS
        value = 0.0
        if signal < 4:
            value = stick[signal]
        elif len(tilt) > 0:
            value = tilt[signal - 4]
        if _observe(channels[number], limits[number], value, near, period_s):
            found |= 1 << number
    return found


@part
def _effect(
    axis: int,
    first: Array,
    last: Array,
    since_far_s: Array,
    least: Array,
) -> float:
    """What a stick has done between two moments of `watch_effects`, as a share of what it asked for."""
    if axis != TURN and abs(last[9] - first[9]) > MOST_TURNED_RAD:
        return DOES_AS_TOLD
    asked = last[axis] - first[axis]
    side = 1 if asked > 0.0 else 0
    if since_far_s[1 - side, axis] < SWING_S or abs(asked) <= least[side, axis]:
        return DOES_AS_TOLD
    done: float = (last[4 + axis] - first[4 + axis]) / asked
    return done


@part
def learn(known: Array, rules: Array, gain: float, period_s: float) -> None:
    """Take in how much of the thrust's gain a window has shown."""
    hover = rules[HOVER_GAIN] / max(gain, 0.05)
    if math.isnan(known[HOVER_THRUST]):
        known[HOVER_THRUST], known[LEARNT_GAIN] = hover, gain
        return
    known[HOVER_THRUST] += period_s / (period_s + BATTERY_TIME_S) * (hover - known[HOVER_THRUST])
    if known[LEARNING_FOR_S] < LEARNING_S:
        known[LEARNING_FOR_S] += period_s
        known[LEARNT_GAIN] += period_s / known[LEARNING_FOR_S] * (gain - known[LEARNT_GAIN])


@part
def judge_thrust(
    known: Array,
    rules: Array,
    thrust: float,
    climbed_m: float,
    asked_m_s: float,
    made_m_s: float,
    gravity_m_s2: float,
    period_s: float,
) -> int:
    """What a window of the thrust shows: height gained, and velocities asked for and made by it."""
    known[FULL_FOR_S] = known[FULL_FOR_S] + period_s if thrust >= rules[FULL_THRUST] else 0.0
    if known[FULL_FOR_S] >= THRUST_WINDOW_S and climbed_m < LEAST_CLIMB_M:
        return THRUST_EXHAUSTED
    if asked_m_s <= 0.5 * THRUST_WINDOW_S * gravity_m_s2:
        return SOUND  # It falls on purpose: nothing can be told from so little thrust.
    known[GAIN] = gain = made_m_s / asked_m_s
    learn(known, rules, gain, period_s)
    if known[LEARNING_FOR_S] < LEARNING_S:
        return SOUND
    recent = rules[HOVER_GAIN] / known[HOVER_THRUST]
    if gain < LEAST_GAIN * known[LEARNT_GAIN] and gain < SUDDEN * recent:
        return THRUST_LOST
    return BATTERY_EMPTY if known[HOVER_THRUST] > rules[LAND_AT] else SOUND


@part
def judge_axes(known: Array, period_s: float) -> int:
    """What effects of pitch, roll and yaw show that have lasted."""
    found = SOUND
    for place in range(3):
        dead = known[EFFECT + place] < DEAD_EFFECT
        known[SUSPECT_S + place] = known[SUSPECT_S + place] + period_s if dead else 0.0
        if found == SOUND and known[SUSPECT_S + place] >= AXIS_PATIENCE_S:
            found = AXIS_AT_FAULT + place
    return found


@compiled(VECTOR, MATRIX, *3 * [ANY_VECTOR], NUMBER, MATRIX, MATRIX, COUNT, COUNT, VECTOR, VECTOR)
def watch_effects(
    vehicle: Array,
    least: Array,
    command: Array,
    sticks: Array,
    motion: Array,
    period_s: float,
    memory: Array,
    moments: Array,
    number: int,
    back: int,
    rules: Array,
    known: Array,
) -> int:
    """Compare what sticks asked for with what the vehicle did, in a control period.

    Parameters
    ----------
    vehicle
        Four input gains, four dampings, four poles of the actuators, gravity; shape (13,).
    least
        Sticks that count as far, and velocity that they ask for in a window, towards the lower and the upper
        limit; shape (4, 4).
    command, sticks
        What is commanded now, and what arrives at the vehicle, shape (4,).
    motion
        Motion state at the beginning, shape (8,).
    memory
        Moved on by a period, shape (5, 4): sticks after their lag, set in the first period; velocity that
        sticks asked for; velocity that damping and turning brought; how long each stick has not been far to
        its lower and upper side.
    moments
        A ring, in which this period is written: velocities asked for and made by the sticks up to its
        beginning, height and yaw; shape (n, 10).
    number
        Of this period since the windows began, from 0.
    back
        Periods in the window of pitch, roll and yaw; the window of the thrust has n - 1. Windows that are not
        full yet tell nothing.
    rules
        See `RULES`.
    known
        See `KNOWN`, changed in place.

    Returns
    -------
    int
        What is wrong, as soon as it is certain, or `SOUND`.
    """
    last = moments[number % len(moments)]
    for axis in range(4):
        if number == 0:
            memory[0, axis] = sticks[axis]
        memory[0, axis] = sticks[axis] + vehicle[8 + axis] * (memory[0, axis] - sticks[axis])
        for side in range(2):
            far = (2.0 * side - 1.0) * memory[0, axis] > least[side, axis]
            memory[3 + side, axis] = 0.0 if far else memory[3 + side, axis] + period_s
        rate = motion[4 + axis]
        last[axis], last[4 + axis] = memory[1, axis], rate - memory[2, axis]
        turning = 0.0
        if axis == 0:
            turning = motion[7] * motion[5]
        elif axis == 1:
            turning = -motion[7] * motion[4]
        elif axis == THRUST:
            turning = -vehicle[12]
        memory[1, axis] += period_s * vehicle[axis] * memory[0, axis]
        memory[2, axis] += period_s * (vehicle[4 + axis] * rate + turning)
    last[8], last[9] = motion[2], motion[3]
    if number >= len(moments) - 1:
        first = moments[(number + 1) % len(moments)]
        climbed_m, asked_m_s = last[8] - first[8], last[THRUST] - first[THRUST]
        made_m_s, gravity = last[4 + THRUST] - first[4 + THRUST], vehicle[12]
        found = judge_thrust(known, rules, command[THRUST], climbed_m, asked_m_s, made_m_s, gravity, period_s)
        if found != SOUND:
            return found
    for place, axis in enumerate((0, 1, TURN)):
        known[EFFECT + place] = DOES_AS_TOLD
        if number >= back:
            first = moments[(number - back) % len(moments)]
            known[EFFECT + place] = _effect(axis, first, last, memory[3:], least[2:])
    return judge_axes(known, period_s)
