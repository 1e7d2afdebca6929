"""Plays the lights of drones: Skybrush's light programs, or colours of a table.

A light program is byte code (`ledctrl`, `libskybrush`): commands of one byte, then colours, a gray or a
count of one byte each, then a duration or a time in fiftieths of a second, seven bits of each byte, the
lowest first.
"""

import re
from typing import NamedTuple

import numpy as np

from rcopterx_studies.importing.skybrush import MAX_DURATION_S, ShowError

TICK_S = 0.02  # of light programs
MAX_COMMANDS = 100_000  # that a light program runs
END, WAIT_UNTIL, SET_COLOUR, FADE_TO_COLOUR, LOOP_BEGIN, LOOP_END, RESET_TIMER = 0, 3, 4, 8, 12, 13, 14
NUMBER = rb"([\x80-\xff]{0,4}[\x00-\x7f])"  # seven bits of each byte, the lowest first
ARGUMENTS = {  # bytes, and for commands of a duration or time a number of up to five
    code: re.compile(b"(.{%d})" % count + (NUMBER if 2 <= code < 12 else b"()"), re.DOTALL)
    for count, codes in ((0, (0, 1, 2, 3, 6, 7, 10, 11, 13, 14)), (1, (5, 9, 12, 20, 21)), (3, (4, 8)))
    for code in codes
}


class Lights(NamedTuple):
    """Colours over the time of a show: they fade in between, and change at once where two have one time."""

    times_s: np.ndarray  # not decreasing, shape (n,)
    colours: np.ndarray  # red, green, blue, 0 to 255, shape (n, 3)


def played(drone):
    """Return the lights of a drone, None without any; raises `ShowError`."""
    if not isinstance(drone.lights, bytes):
        return None if drone.lights is None else Lights(drone.times_s, drone.lights)
    try:
        return lights_of(drone.lights)
    except ValueError as error:
        raise ShowError(f"{drone.name}: {error}") from None


def lights_of(program):
    """Run a light program for `MAX_DURATION_S` at most; raises `ValueError`."""
    loops = []  # where they begin, and how often they still run, 0 for ever
    changes = [(0, bytes(3))]
    at = ticks = timer = 0
    for _ in range(MAX_COMMANDS):
        code = program[at] if at < len(program) else END
        if code not in ARGUMENTS or (found := ARGUMENTS[code].match(program, at + 1)) is None:
            raise ValueError(f"command {code} at byte {at} of the light program cannot be played")
        if code == END or TICK_S * ticks > MAX_DURATION_S:
            times, colours = zip(*changes, strict=True)
            return Lights(TICK_S * np.array(times), np.array([*map(list, colours)], dtype=float))
        at, values, number = found.end(), found[1], sum((b & 127) << 7 * i for i, b in enumerate(found[2]))
        if SET_COLOUR <= code < LOOP_BEGIN:
            colour = (values, 3 * values, bytes(3), 3 * b"\xff")[code % 4]
            changes += [(ticks, changes[-1][1]), (ticks + (code >= FADE_TO_COLOUR) * number, colour)]
        ticks = max(ticks, timer + number) if code == WAIT_UNTIL else ticks + number
        if code == RESET_TIMER:
            timer = ticks
        elif code == LOOP_BEGIN:
            loops.append((at, values[0]))
        elif code == LOOP_END and loops:
            begin, rounds = loops.pop()
            if rounds != 1:
                at = begin
                loops.append((begin, max(0, rounds - 1)))
    raise ValueError(f"the light program runs more than {MAX_COMMANDS} commands")
