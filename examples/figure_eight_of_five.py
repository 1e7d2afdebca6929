"""Five helicopters fly a figure-eight in formation: python figure_eight_of_five.py [FLEET]."""

import sys

from rcopterx import figure_eight, launched

HALF_SIZE_M = (0.3, 0.15)
PERIOD_S = 12.0


def fly(fleet):
    """The leader flies the eight, each other vehicle follows the plan of the one before it."""
    leader = next(iter(fleet.file.vehicles))
    fleet.take_off()
    fleet[leader].go_to((0.2, 0.0, 1.0))
    fleet.wait_for_arrival()
    fleet.wait_for_formation()
    fleet[leader].fly(figure_eight((0.2, 0.0, 1.0), HALF_SIZE_M, PERIOD_S), wait=True)
    fleet.wait_for_formation()
    for name in fleet.file.vehicles:
        print(name, "is at", [round(value, 2) for value in fleet.state_of(name).position_m])


def main(name="quintet"):
    """Start the fleet and fly."""
    with launched(name) as fleet:
        fly(fleet)


if __name__ == "__main__":
    main(*sys.argv[1:])
