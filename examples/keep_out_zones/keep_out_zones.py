"""Two helicopters fly round a pillar, a table and a visitor, and are refused what leads into them."""

import sys
from pathlib import Path

from rcopterx import RefusedError, Zone, launched

FLEET = Path(__file__).with_suffix(".toml")


def refused(request, *arguments):
    """Make a request that the fleet has to refuse, and return why."""
    try:
        request(*arguments)
    except RefusedError as error:
        print(error)
        return str(error)
    raise SystemExit(f"{request.__name__}{arguments} was not refused")


def fly(fleet):
    """Try straight ways and places in zones, then go round, and come home; return the refusals."""
    reasons = []
    fleet.take_off(height_m=0.8)
    reasons.append(refused(fleet["h1"].go_to, (1.1, 0.0, 0.8)))  # the pillar is in between
    fleet["h1"].go_to((0.6, -0.7, 0.8))
    fleet.wait_for_arrival()
    reasons.append(refused(fleet["h1"].go_to, (1.1, 0.0, 0.8)))  # it would be free, its follower would not
    reasons.append(
        refused(fleet.form, "line", "h1", 0.6)
    )  # again: the place beside h1 is taken by the pillar
    fleet["h2"].lead()
    fleet["h2"].go_to((-0.6, 0.9, 1.0))
    fleet.wait_for_arrival()
    reasons.append(refused(fleet["h2"].land))  # above the table
    fleet["h1"].go_to((0.9, 0.6, 0.8))  # nothing follows it any more: it flies round the pillar
    fleet.wait_for_arrival(timeout_s=30.0)
    fleet.set_zone("visitor", Zone(min_m=(-0.9, -0.9, 0.0), max_m=(-0.4, -0.5, 1.9)))
    reasons.append(refused(fleet["h2"].go_to, (-0.6, -0.6, 1.0)))
    fleet["h1"].go_to((1.1, -0.2, 0.8))
    fleet.wait_for_arrival()
    fleet.home()  # h1 behind the pillar, h2 above the table
    return reasons


def main(path=FLEET):
    """Start the fleet and fly."""
    with launched(path) as fleet:
        fly(fleet)


if __name__ == "__main__":
    main(*sys.argv[1:])
