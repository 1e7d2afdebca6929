"""Checks of the exercise sheet: each says what is wrong, or that the task is passed."""

import math
from itertools import combinations

from rcopterx import RefusedError, circle

SIDE_M = 0.8
TOLERANCE_M = 0.1
RADIUS_M = 0.4
CENTER_M = (0.0, 0.0, 1.0)
STEP_S = 0.5


class NotYetError(AssertionError):
    """The task is not solved; the text says what is missing."""


def check_triangle(fleet):
    """Task 1: all three hover at one height, 0.8 m from each other."""
    positions = {vehicle.name: vehicle.state.position_m for vehicle in fleet}
    for first, second in combinations(positions, 2):
        distance_m = math.dist(positions[first], positions[second])
        if abs(distance_m - SIDE_M) > TOLERANCE_M:
            raise NotYetError(f"{first} and {second} are {distance_m:.2f} m from each other, not {SIDE_M} m")
    heights_m = [z for _, _, z in positions.values()]
    if max(heights_m) - min(heights_m) > TOLERANCE_M:
        raise NotYetError(f"heights differ by {max(heights_m) - min(heights_m):.2f} m")
    print("passed: triangle")


def check_shortest_circle(fleet, period_s):
    """Task 2: a circle of 0.4 m with this period is accepted, with half a second less it is refused."""
    leader = next(iter(fleet))
    if accepted(leader, period_s - STEP_S):
        raise NotYetError(f"{period_s - STEP_S:g} s is flown as well")
    if not accepted(leader, period_s):
        raise NotYetError(f"{period_s:g} s is refused")
    print("passed: shortest circle")


def accepted(vehicle, period_s):
    """Whether a vehicle flies the circle; it then begins to."""
    try:
        vehicle.fly(circle(CENTER_M, RADIUS_M, period_s))
    except RefusedError:
        return False
    return True


def check_handed_over(fleet, before_m):
    """Task 3: h3 leads all vehicles, and each has kept its place."""
    leaders = {vehicle.name: vehicle.state.leaders for vehicle in fleet}
    if leaders["h3"]:
        raise NotYetError(f"h3 still follows {', '.join(leaders['h3'])}")
    others = [name for name in leaders if name != "h3" and leaders[name] != ("h3",)]
    if others:
        raise NotYetError(f"{', '.join(others)} does not follow h3")
    for vehicle in fleet:
        moved_m = math.dist(vehicle.state.position_m, before_m[vehicle.name])
        if moved_m > 2 * TOLERANCE_M:
            raise NotYetError(f"{vehicle.name} has moved {moved_m:.2f} m")
    print("passed: handed over")
