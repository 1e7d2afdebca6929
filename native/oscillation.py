"""Kernel that counts half-waves of sticks and tilt (`rcopterx.agents.flight.oscillation`)."""

import math

from rcopterx.native.compiled import ANY_VECTOR, MATRIX, NUMBER, VECTOR, Array, compiled, part

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
COUNT = 4
COUNT_NEAR = 5
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
        channel[COUNT] = 1.0
    elif _alike(channel):
        channel[COUNT] += 1.0
    else:
        # An oscillation that begins, or is disturbed, has some that are unlike.
        channel[COUNT] = max(channel[COUNT] - 1.0, 1.0)
    channel[COUNT_NEAR] = min(channel[COUNT_NEAR] + 1.0, channel[COUNT])
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
        channel[COUNT] = channel[COUNT_NEAR] = 0.0
    if not near:
        channel[COUNT_NEAR] = 0.0
    enough = channel[COUNT_NEAR] >= limits[NEEDED_NEAR] or channel[COUNT] >= limits[NEEDED]
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
