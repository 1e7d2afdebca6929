"""Vehicles of a formation change their batteries in turn: python rotation.py FLEET --places N --minutes M.

Places are on a ring around the origin. Before the battery of a vehicle is empty, a charged one takes off,
flies around the ring, and takes its place; the empty one flies home, lands and charges. See docs/examples.md.
"""

import argparse
import math

from rcopterx import NotReachedError, RefusedError, launched, through

HEIGHT_M = 1.0
SPACING_M = 0.9  # between two places
BESIDE_M = 0.55  # from the ring of places to the one on which vehicles come and go
BESIDE_RAD = math.radians(
    25.0
)  # between a place and where its next vehicle waits, and where its last one goes
SPEED_M_S = 0.4  # on the way around
POINT_RAD = math.radians(15.0)
PERIOD_S = 45.0  # shortest time between two changes
RESERVE_S = 30.0  # flight time with which a vehicle has to begin its way home
UNFIT_S = 300.0  # for which a vehicle that could not take its place is not tried again
PROBLEMS = (RuntimeError, NotReachedError)  # a request that was refused or failed, or took too long


def next_change(left_s, charged, period_s=PERIOD_S):
    """Return the place that is to be filled next, and by which vehicle; None if there is time.

    `left_s`: shortest remaining flight time of the vehicle in each place, 0 for an empty one. Places are
    filled one after the other, the one with the least time first, no sooner than needed for all of them.
    """
    urgent = sorted(left_s, key=left_s.get)
    late = any(left_s[place] < RESERVE_S + period_s * count for count, place in enumerate(urgent, 1))
    return (urgent[0], charged[0]) if late and charged else None


class Ring:
    """Places on a circle, and the circle around it on which vehicles come and go."""

    def __init__(self, places):
        self.radius_m = SPACING_M / (2.0 * math.sin(math.pi / places))
        self.angles_rad = [2.0 * math.pi * place / places for place in range(places)]

    def place_m(self, place):
        """Return where a place is."""
        return _point_m(self.radius_m, self.angles_rad[place])

    def offset_m(self, place, leader_place):
        """Return the offset of a place to that of the leader."""
        return [
            own - other for own, other in zip(self.place_m(place), self.place_m(leader_place), strict=True)
        ]

    def beside_m(self, place, side):
        """Return the point beside a place where its next vehicle waits (1), or its last one goes (-1)."""
        return _point_m(self.radius_m + BESIDE_M, self.angles_rad[place] + side * BESIDE_RAD)

    def way(self, begin_m, place):
        """Return the trajectory around the ring from a charging place to where a vehicle waits."""
        begin_rad, radius_m = math.atan2(begin_m[1], begin_m[0]), self.radius_m + BESIDE_M
        turn_rad = math.remainder(self.angles_rad[place] + BESIDE_RAD - begin_rad, 2.0 * math.pi)
        count = 1 + math.ceil(abs(turn_rad) / POINT_RAD)
        step_s = max(radius_m * abs(turn_rad) / count / SPEED_M_S, 0.5)
        points_m = [_point_m(radius_m, begin_rad + turn_rad * step / count) for step in range(count + 1)]
        return through([(step * step_s, *point_m, 0.0) for step, point_m in enumerate(points_m)])


def _point_m(radius_m, angle_rad):
    return radius_m * math.cos(angle_rad), radius_m * math.sin(angle_rad), HEIGHT_M


class Rotation:
    """Keeps the places of a formation filled.

    `in_place` has the vehicle of each place, None for an empty one; `changes` counts what was filled.
    """

    def __init__(self, fleet, places, period_s=PERIOD_S, say=print):
        self.fleet, self.ring, self.period_s, self.say = fleet, Ring(places), period_s, say
        self.in_place = list(fleet.file.vehicles)[:places]
        self.changes = 0
        self._fit_from_s = dict.fromkeys(fleet.file.vehicles, 0.0)

    def fly(self, minutes):
        """Fill the places, keep them filled for a time, then bring all home."""
        fleet = self.fleet
        end_s = fleet.session.clock() + 60.0 * minutes
        self.begin()
        while fleet.session.clock() < end_s:
            if not self.step():
                fleet.wait(1.0)
        fleet.home()

    def begin(self):
        """Fill the places; the first vehicle leads."""
        fleet, (leader, *others) = self.fleet, self.in_place
        fleet.take_off(self.in_place, HEIGHT_M)
        fleet[leader].go_to(self.ring.place_m(0))
        for place, name in enumerate(others, 1):
            fleet[name].follow(leader, self.ring.offset_m(place, 0))
        fleet.wait_for_arrival([leader])
        fleet.wait_for_formation(others)

    def step(self):
        """Fill a place if it is time to; return whether one was."""
        states = {vehicle.name: vehicle.state for vehicle in self.fleet}
        now_s = self.fleet.session.clock()
        for stray in [name for name, state in states.items() if state.airborne and name not in self.in_place]:
            self._home(stray)
        self.in_place = [name if name and states[name].airborne else None for name in self.in_place]
        left_s = {place: _left_s(states, name) for place, name in enumerate(self.in_place)}
        charged = [
            name
            for name, state in states.items()
            if state.battery is not None and state.battery.charged and self._fit_from_s[name] <= now_s
        ]
        change = next_change(left_s, charged, self.period_s)
        if change is None:
            self._bring_home_what_is_empty(left_s)
            return False
        place, new = change
        try:
            self.replace(place, new, self._leader(place, left_s))
        except PROBLEMS as error:
            self.say(f"{new} does not take place {place}: {error}")
            self._fit_from_s[new] = now_s + UNFIT_S
            self._home(new)
            return False
        return True

    def _leader(self, vacated, left_s):
        """Return the place whose vehicle leads: another one than that which is vacated."""
        fleet, flying = self.fleet, {place: name for place, name in enumerate(self.in_place) if name}
        leading = [place for place, name in flying.items() if not fleet.state_of(name).assigned]
        if leading and leading[0] != vacated:
            return leading[0]
        place = max(flying.keys() - {vacated}, key=left_s.get)
        try:
            fleet.promote(flying[place])
        except RefusedError:  # The present leader does not fly any more.
            fleet[flying[place]].lead()
            for other in flying.keys() - {place}:
                fleet[flying[other]].follow(flying[place], self.ring.offset_m(other, place))
        self.say(f"{flying[place]} leads")
        return place

    def replace(self, place, new, leader):
        """Let a charged vehicle follow that of another place, in a place whose vehicle then flies home."""
        fleet, old = self.fleet, self.in_place[place]
        fleet.take_off([new], HEIGHT_M)
        fleet[new].fly(self.ring.way(fleet.state_of(new).position_m, place), wait=True)
        if old:
            text = f" of {old}, {fleet.state_of(old).battery_text}"
            fleet[old].lead()
            fleet[old].go_to(self.ring.beside_m(place, -1))
        fleet[new].follow(self.in_place[leader], self.ring.offset_m(place, leader))
        self.in_place[place] = new
        fleet.wait_for_formation([new])
        self.changes += 1
        self.say(f"{new} in the place{text if old else f' {place}'}")
        self._home(old)

    def _bring_home_what_is_empty(self, left_s):
        """Let a vehicle that has only the time for its way home leave, though none replaces it."""
        place = min(left_s, key=left_s.get)
        if self.in_place[place] and left_s[place] < RESERVE_S:
            self._leader(place, left_s)
            old, self.in_place[place] = self.in_place[place], None
            self.say(f"{old} leaves its place, and no vehicle is charged")
            self._home(old)

    def _home(self, name):
        if name and self.fleet.state_of(name).airborne:
            try:
                self.fleet.home([name])
            except PROBLEMS as error:  # Beside its place it waits for the next try.
                self.say(f"{name} does not come home: {error}")


def _left_s(states, name):
    """Shortest remaining flight time of a vehicle; 0 for none, or if it is unknown or low."""
    battery = states[name].battery if name else None
    return 0.0 if battery is None or battery.low or battery.left_s is None else battery.left_s[0]


def main():
    """Start the fleet and fly."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fleet")
    parser.add_argument("--places", type=int, default=3)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--period", type=float, default=PERIOD_S, help="between two changes [s]")
    arguments = parser.parse_args()
    with launched(arguments.fleet) as fleet:
        Rotation(fleet, arguments.places, arguments.period).fly(arguments.minutes)


if __name__ == "__main__":
    main()
