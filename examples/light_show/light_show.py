"""Fly a drone show indoors: python light_show.py SHOW.skyc [--fleet FLEET] [--slower FACTOR].

The whole show is shrunk into the flight volume: x and y by one factor, heights by another. Lights follow the
trajectories: `rcopterx suspend`, `resume` and `home` in another terminal pause, resume and end both.
"""

import argparse
from contextlib import suppress
from itertools import combinations

import numpy as np
from light_programs import played

from rcopterx import NotReachedError, RefusedError, launched, through
from rcopterx.bus.session import RequestFailedError
from rcopterx.control.references.paths import path_problem
from rcopterx.fleet.vehicle_models import model_of
from rcopterx_studies.importing.skybrush import ShowError, read_show

MARGIN_M = 0.3
LOWEST_M = 0.6
CLOSEST_M = 0.5
"""Of two drones in the shrunk show; a little more than vehicles keep clear of each other."""

OFF = (0, 0, 0)
SHADE = 5  # smallest change of a colour that is sent
STATUS_S = 0.1  # statuses arrive five times a second, and so do new colours
EARLY_S = 1.0  # left of a trajectory that was given up
LOST_S = 10.0  # without a status; a restarted agent goes on with the trajectory
HOMEWARD_S = 60.0  # until vehicles that were called home have landed
DISARMED_S = 3.0  # after the landing, for those who called them home


def fitted(drones, low_m, high_m):
    """The same show in a box, as drones with other positions; ShowError if two come too close there."""
    everything = np.vstack([drone.positions_m for drone in drones])
    least, most = everything.min(axis=0), everything.max(axis=0)
    low_m, high_m = np.array(low_m), np.array(high_m)
    factors = (high_m - low_m) / np.maximum(most - least, 1e-9)
    scale = np.minimum([factors[:2].min(), factors[:2].min(), factors[2]], 1.0)
    middle_m = 0.5 * (low_m + high_m)
    shrunk = [
        drone._replace(positions_m=middle_m + scale * (drone.positions_m - 0.5 * (least + most)))
        for drone in drones
    ]
    check_distances(shrunk)
    return shrunk


def check_distances(drones):
    """Refuse a show in which two drones are too close at any time."""
    end_s = max(drone.times_s[-1] for drone in drones)
    times_s = np.arange(0.0, end_s + 0.1, 0.1)
    courses = [
        np.column_stack([np.interp(times_s, drone.times_s, column) for column in drone.positions_m.T])
        for drone in drones
    ]
    for (one, first), (other, second) in combinations(zip(drones, courses, strict=True), 2):
        distances = np.linalg.norm(first - second, axis=1)
        if distances.min() < CLOSEST_M:
            raise ShowError(
                f"{one.name} and {other.name} are {distances.min():.2f} m from each other at "
                f"{times_s[distances.argmin()]:.1f} s; {CLOSEST_M} m are needed"
            )


def path_of(drone, begin_s, end_s, slower):
    """Its trajectory over the time of the show; before and after its own it stays where it is."""
    times_s = np.unique(np.concatenate([[begin_s], drone.times_s, [end_s]]))
    columns = [*drone.positions_m.T, drone.yaws_rad]
    poses = [np.interp(times_s, drone.times_s, column) for column in columns]
    return through(np.column_stack([slower * (times_s - begin_s), *poses]), whole_turns=True)


def check_limits(file, paths):
    """Refuse a show that moves or turns faster than a vehicle can, while all stand on the floor."""
    for name, path in paths.items():
        if (problem := path_problem(path, model_of(file, name), path.duration_s)) is not None:
            raise ShowError(f"{name}: {problem} (--slower)")


def colour_of(lights, time_s):
    """A colour at a time of the show: red, green and blue, in shades that differ visibly."""
    if lights is None:
        return OFF
    exact = [np.interp(time_s, lights.times_s, part) for part in lights.colours.T]
    return tuple(SHADE * round(part / SHADE) for part in exact)


class Lamps:
    """The lights of vehicles, first off; a colour is sent once it has changed."""

    def __init__(self, fleet, names):
        self._fleet = fleet
        self._shown = dict.fromkeys(names)
        for name in names:
            self.show(name, OFF)
        if dark := [name for name in names if name not in self._shown]:
            print(f"without lights: {', '.join(dark)}")

    def show(self, name, colour):
        """Show a colour, on a vehicle that has lights."""
        if name not in self._shown or self._shown[name] == colour:
            return
        try:
            self._fleet[name].light(colour)
            self._shown[name] = colour
        except RefusedError:
            del self._shown[name]
        except RequestFailedError:
            pass  # It did not answer: the colour is sent again soon.


def play(fleet, lamps, lights, paths, begin_s, slower):
    """Show lights while vehicles fly their paths; returns who left the show before its end.

    The time along a path stands still while the fleet is suspended; `home` or another task ends the path.
    """
    left_s = {name: path_left_s(fleet, name) for name in paths}
    early = []
    while left_s:
        fleet.wait(STATUS_S)
        for name, before_s in list(left_s.items()):
            left_s[name] = min(before_s, path_left_s(fleet, name))  # Lights do not go back at `resume`.
            along_s = paths[name].duration_s - left_s[name]  # Below 0 on the way to the beginning.
            ended = left_s[name] == 0.0
            dark = ended or along_s < 0.0
            lamps.show(name, OFF if dark else colour_of(lights[name], begin_s + along_s / slower))
            if ended:
                del left_s[name]
            if ended and before_s > EARLY_S:
                print(f"{name} leaves the show {before_s:.0f} s before its end")
                early.append(name)
    return early


def path_left_s(fleet, name):
    """What is left of a vehicle's trajectory; 0 without one."""
    state = fleet.state_of(name)
    return 0.0 if state.agent is None or state.agent_age_s > LOST_S else state.agent.path_left_s


def fly(fleet, drones, slower=1.0):
    """Take off, go to the first positions, fly the show together."""
    names = list(fleet.file.vehicles)[: len(drones)]
    if len(names) < len(drones):
        raise ShowError(f"{len(drones)} drones, but only {len(names)} vehicles")
    volume = fleet.file.volume
    low_m = [volume.min_m[0] + MARGIN_M, volume.min_m[1] + MARGIN_M, volume.min_m[2] + LOWEST_M]
    shrunk = fitted(drones, low_m, [value - MARGIN_M for value in volume.max_m])
    drones = dict(zip(names, shrunk, strict=True))
    begin_s = min(drone.times_s[0] for drone in shrunk)
    end_s = max(drone.times_s[-1] for drone in shrunk)
    paths = {name: path_of(drone, begin_s, end_s, slower) for name, drone in drones.items()}
    check_limits(fleet.file, paths)
    lights = {name: played(drone) for name, drone in drones.items()}
    lamps = Lamps(fleet, names)
    fleet.take_off(names)
    for name in names:
        fleet[name].lead()
    for name, drone in drones.items():
        fleet[name].go_to(drone.positions_m[0], drone.yaws_rad[0])
    fleet.wait_for_arrival(names, timeout_s=60)
    for name, path in paths.items():
        fleet[name].fly(path)
    fleet.wait_until(
        lambda: all(path_left_s(fleet, name) > 0.0 for name in names), 2, "it does not begin", names
    )
    try:
        early = play(fleet, lamps, lights, paths, begin_s, slower)
    finally:
        for name in names:
            lamps.show(name, OFF)
    if early:
        wait_for_landing(fleet, early)


def wait_for_landing(fleet, names):
    """Let vehicles that were called home come home, instead of landing where they are."""
    with suppress(NotReachedError):  # They were sent elsewhere.
        fleet.wait_until(
            lambda: not any(fleet.state_of(name).airborne for name in names), HOMEWARD_S, "in the air", names
        )
        fleet.wait(DISARMED_S)


def main():
    """Fly the show that was named."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("show", help="a .skyc file of Skybrush, or a zip of CSV files")
    options.add_argument("--fleet", default="quintet")
    options.add_argument("--slower", type=float, default=1.0, metavar="FACTOR")
    chosen = options.parse_args()
    try:
        drones = read_show(chosen.show)
        with launched(chosen.fleet) as fleet:
            fly(fleet, drones, chosen.slower)
    except (ShowError, RefusedError, NotReachedError) as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
