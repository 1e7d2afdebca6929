"""Five helicopters follow a wand that a person moves, and make way for a hand that walks through them.

In a laboratory the motion capture tracks both; here they are simulated, and requests move them.
"""

import sys
from pathlib import Path

import numpy as np

from rcopterx import launched
from rcopterx.bus.requests import Inject, InjectedFault

FLEET = Path(__file__).with_suffix(".toml")
LED_M = (
    (0.9, 0.0, 1.0),
    (0.9, 0.5, 1.1),
    (0.3, 0.5, 1.2),
    (0.3, -0.5, 1.0),
    (0.9, -0.5, 1.0),
    (0.9, 0.0, 1.0),
)
WALK_M = ((1.7, 0.25, 1.0), (-1.7, 0.25, 1.0))  # past the vehicle in the middle, nearer than it is to others
SETTLING_S = 3.0
PERIOD_S = 0.02  # between two places of a motion
SMOOTHED_S = 0.8
NOISE_M = 0.0003


def inject(fleet, kind, **fields):
    """Change what the simulated motion capture shows."""
    request = Inject(faults=(InjectedFault(0.0, {"kind": kind, **fields}),))
    assert fleet.session.request("simulator", request).accepted


def move(fleet, subject, way_m, speed_m_s):
    """Show a subject that moves through places, as a person would move it; return how long it takes."""
    places_m = np.array(way_m)
    legs_s = np.linalg.norm(np.diff(places_m, axis=0), axis=1) / speed_m_s
    passed_s = np.append(0.0, np.cumsum(legs_s))
    times_s = np.arange(0.0, passed_s[-1] + SMOOTHED_S, PERIOD_S)
    # People round off corners: the average over the last moments, weighted by a raised cosine.
    ages_s = np.arange(0.5 * PERIOD_S, SMOOTHED_S, PERIOD_S)
    weights = (1.0 - np.cos(2.0 * np.pi * ages_s / SMOOTHED_S)) / len(ages_s)
    axes_m = [np.interp(times_s[:, None] - ages_s, passed_s, axis_m) @ weights for axis_m in places_m.T]
    seen_m = np.transpose(axes_m) + np.random.default_rng(1).normal(0.0, NOISE_M, (len(times_s), 3))
    way = np.column_stack((times_s[1:], seen_m[1:])).tolist()
    inject(fleet, "add_subject", subject=subject, position_m=way_m[0], way=way)
    return times_s[-1]


def lead(fleet, way_m=LED_M, speed_m_s=0.5):
    """Let the wand lead the formation at half a metre a second."""
    fleet.wait(move(fleet, "wand", way_m[:1], speed_m_s) + SETTLING_S)
    print(fleet["h1"].follow("wand", (-0.9, 0.0, 0.0)))
    fleet.wait(SETTLING_S)
    fleet.wait(move(fleet, "wand", way_m, speed_m_s))


def lose(fleet):
    """Let the wand vanish: who followed it holds its place, and leads on request; return what it did."""
    inject(fleet, "recover")
    fleet.wait(SETTLING_S)
    did = fleet.state_of("h1").agent.following_mode
    print(f"h1: {did}, the wand is {fleet.state_of('wand').phase}")
    fleet["h1"].lead()
    return did


def walk(fleet, way_m=WALK_M, speed_m_s=1.0):
    """Let the formation hover, and a hand walk through it at a metre a second."""
    fleet["h1"].go_to((0.0, 0.0, 1.0))
    fleet.wait_for_arrival(["h1"])
    fleet.wait(move(fleet, "right_hand", way_m, speed_m_s))
    fleet.wait_for_formation()


def main(path=FLEET):
    """Start the fleet and fly."""
    with launched(path) as fleet:
        fleet.take_off(height_m=1.0)
        lead(fleet)
        lose(fleet)
        walk(fleet)
        fleet.home()


if __name__ == "__main__":
    main(*sys.argv[1:])
