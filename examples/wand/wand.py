"""Five helicopters follow a wand that a person moves, and make way for a hand that walks through them.

In a laboratory the motion capture tracks both; here they are simulated, and requests move them.
"""

import math
import sys
from itertools import pairwise
from pathlib import Path

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


def inject(fleet, kind, **fields):
    """Change what the simulated motion capture shows."""
    request = Inject(faults=(InjectedFault(0.0, {"kind": kind, **fields}),))
    assert fleet.session.request("simulator", request).accepted


def move(fleet, subject, way_m, speed_m_s):
    """Show a subject that moves, as a person would move it, and return how long it takes."""
    fields = {"position_m": way_m[0], "way_m": way_m[1:], "speed_m_s": speed_m_s, "deviation_m": 0.0003}
    inject(fleet, "add_subject", subject=subject, **fields)
    length_m = sum(math.dist(*leg) for leg in pairwise(way_m))
    return length_m / speed_m_s + 1.0


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
