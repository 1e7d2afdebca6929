"""A formation whose leader changes twice while it flies a circle: python changing_leaders.py [FLEET]."""

import sys

from rcopterx import circle, launched

PERIOD_S = 12.0


def fly(fleet):
    """The first vehicle leads, then the second, then the third; no vehicle jumps at a change."""
    first, second, third = list(fleet.file.vehicles)[:3]
    fleet.take_off()
    fleet.wait_for_formation()
    for leader in (first, second, third):
        if leader != first:
            fleet.promote(leader)
            fleet.wait_for_formation()
        x, y, z = fleet.state_of(leader).position_m
        fleet[leader].fly(circle((x - 0.3, y, z), 0.3, PERIOD_S), wait=True)
        fleet.wait_for_formation()
        print(f"{leader} has led; followers: {', '.join(fleet.followers(leader))}")


def main(name="trio"):
    """Start the fleet and fly."""
    with launched(name) as fleet:
        fly(fleet)


if __name__ == "__main__":
    main(*sys.argv[1:])
