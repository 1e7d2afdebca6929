"""A formation whose vehicles change their batteries in turn: python rotation.py FLEET PLACES MINUTES.

Places are on a ring around the origin. Before the battery of a vehicle is empty, a charged one takes off, flies
around the ring, and takes its place; the empty one flies home, lands and charges. See docs/examples.md.
"""

import argparse
import math

from rcopterx import launched, through

HEIGHT_M = 1.0
SPACING_M = 0.9  # between two places
BESIDE_M = 0.55  # from the ring of places to the one on which vehicles come and go
BESIDE_RAD = math.radians(25.0)  # between a place and where its next vehicle waits, and where its last one goes
SPEED_M_S = 0.4  # on the way around
POINT_RAD = math.radians(15.0)
CHANGE_S = 45.0  # longest time of a change, the landing included
RESERVE_S = 30.0  # shortest predicted flight time with which a vehicle is at home


def next_change(left_s, charged):
    """Return the vehicle that is to be replaced next, and by which one; None if there is time.

    `left_s`: shortest remaining flight time of each vehicle in its place. Vehicles are replaced one after the
    other, the one with the least time first, as soon as there is time for all changes only if they begin now.
    """
    urgent = sorted(left_s, key=left_s.get)
    late = any(left_s[name] < RESERVE_S + CHANGE_S * (count + 1) for count, name in enumerate(urgent))
    return (urgent[0], charged[0]) if late and charged else None


class Ring:
    """Places on a circle, and the circle around it on which vehicles come and go."""

    def __init__(self, places):
        self.radius_m = SPACING_M / (2.0 * math.sin(math.pi / places))
        self.angles_rad = [2.0 * math.pi * number / places for number in range(places)]

    def place_m(self, number):
        """Return a place."""
        return self._point_m(self.radius_m, self.angles_rad[number])

    def beside_m(self, number, side):
        """Return the point beside a place where its next vehicle waits (1), or its last one goes (-1)."""
        return self._point_m(self.radius_m + BESIDE_M, self.angles_rad[number] + side * BESIDE_RAD)

    def way(self, place_m, number):
        """Return the trajectory around the ring from above the charging place to where a vehicle waits."""
        begin_rad, end_rad = math.atan2(place_m[1], place_m[0]), self.angles_rad[number] + BESIDE_RAD
        turn_rad = math.remainder(end_rad - begin_rad, 2.0 * math.pi)
        count = 1 + math.ceil(abs(turn_rad) / POINT_RAD)
        radius_m = self.radius_m + BESIDE_M
        step_s = max(radius_m * abs(turn_rad) / count / SPEED_M_S, 0.5)
        angles_rad = [begin_rad + turn_rad * step / count for step in range(count + 1)]
        return through(
            [(step * step_s, *self._point_m(radius_m, angle), 0.0) for step, angle in enumerate(angles_rad)]
        )

    @staticmethod
    def _point_m(radius_m, angle_rad):
        return radius_m * math.cos(angle_rad), radius_m * math.sin(angle_rad), HEIGHT_M


class Rotation:
    """Keeps the places of a formation filled: `in_place` has the vehicle of each place."""

    def __init__(self, fleet, places, say=print):
        self.fleet, self.ring, self.say = fleet, Ring(places), say
        self.in_place = list(fleet.file.vehicles)[:places]
        self.changes = 0

    def begin(self):
        """Take off and fly to the places; the first vehicle leads."""
        fleet, (leader, *others) = self.fleet, self.in_place
        fleet.take_off(self.in_place, HEIGHT_M)
        x, y, _ = first_m = self.ring.place_m(0)
        fleet[leader].go_to(first_m)
        for number, name in enumerate(others, 1):
            px, py, _ = self.ring.place_m(number)
            fleet[name].follow(leader, (px - x, py - y, 0.0))
        fleet.wait_for_arrival([leader])
        fleet.wait_for_formation(others)

    def step(self):
        """Replace a vehicle if it is time to; return whether one was replaced."""
        states = {vehicle.name: vehicle.state for vehicle in self.fleet}
        left_s = {name: states[name].battery.left_s[0] for name in self.in_place}
        charged = [name for name in states if name not in self.in_place and states[name].battery.charged]
        if (change := next_change(left_s, charged)) is None:
            return False
        if not states[change[0]].assigned:
            successor = max(left_s, key=left_s.get)
            self.fleet.promote(successor)
            self.say(f"{successor} leads instead of {change[0]}")
        self.replace(*change)
        return True

    def replace(self, old, new):
        """Let a charged vehicle take the place of a follower, which flies home."""
        fleet, number = self.fleet, self.in_place.index(old)
        fleet.take_off([new], HEIGHT_M)
        fleet[new].fly(self.ring.way(fleet.state_of(new).position_m, number), wait=True)
        links = fleet.state_of(old).assigned
        fleet[old].lead()
        fleet[old].go_to(self.ring.beside_m(number, -1))
        fleet[new].follow(links)
        self.in_place[number] = new
        fleet.wait_for_formation([new])
        self.changes += 1
        self.say(f"{new} in the place of {old}, {fleet.state_of(old).battery_text}")
        fleet.home([old])

    def fly(self, minutes):
        """Keep the places filled for a time, then bring all home."""
        fleet = self.fleet
        end_s = fleet.session.clock() + 60.0 * minutes
        self.begin()
        while fleet.session.clock() < end_s:
            if not self.step():
                fleet.wait(1.0)
        fleet.home()


def main():
    """Start the fleet and fly."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fleet")
    parser.add_argument("places", type=int)
    parser.add_argument("minutes", type=float)
    arguments = parser.parse_args()
    with launched(arguments.fleet) as fleet:
        Rotation(fleet, arguments.places).fly(arguments.minutes)


if __name__ == "__main__":
    main()
