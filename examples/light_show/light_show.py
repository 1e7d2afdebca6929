"""Fly a drone show indoors: python light_show.py SHOW.skyc [--fleet FLEET] [--slower FACTOR].

The whole show is shrunk into the flight volume: x and y by one factor, heights by another.
"""

import argparse
from itertools import combinations

import numpy as np

from rcopterx import launched, through
from rcopterx_studies.importing.skybrush import ShowError, read_show

MARGIN_M = 0.3
LOWEST_M = 0.6
CLOSEST_M = 0.5
"""Of two drones in the shrunk show; a little more than vehicles keep clear of each other."""


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
    columns = [np.interp(times_s, drone.times_s, column) for column in drone.positions_m.T]
    return through(np.column_stack([slower * (times_s - begin_s), *columns, np.zeros(len(times_s))]))


def fly(fleet, drones, slower=1.0):
    """Take off, go to the first positions, fly the show together."""
    names = list(fleet.file.vehicles)[: len(drones)]
    if len(names) < len(drones):
        raise ShowError(f"{len(drones)} drones, but only {len(names)} vehicles")
    volume = fleet.file.volume
    low_m = [volume.min_m[0] + MARGIN_M, volume.min_m[1] + MARGIN_M, volume.min_m[2] + LOWEST_M]
    drones = fitted(drones, low_m, [value - MARGIN_M for value in volume.max_m])
    begin_s = min(drone.times_s[0] for drone in drones)
    end_s = max(drone.times_s[-1] for drone in drones)
    paths = {name: path_of(drone, begin_s, end_s, slower) for name, drone in zip(names, drones, strict=True)}
    fleet.take_off(names)
    for name in names:
        fleet[name].lead()
    for name, drone in zip(names, drones, strict=True):
        fleet[name].go_to(drone.positions_m[0])
    fleet.wait_for_arrival(names, timeout_s=60)
    for name, path in paths.items():
        fleet[name].fly(path)
    longest_s = max(path.duration_s for path in paths.values())
    fleet.wait_until(lambda: all(left_s(fleet, name) > 0.0 for name in names), 2, "it does not begin", names)
    fleet.wait_until(
        lambda: all(left_s(fleet, name) == 0.0 for name in names), longest_s + 30, "it does not end", names
    )


def left_s(fleet, name):
    """What is left of a vehicle's trajectory."""
    status = fleet.state_of(name).agent
    return 0.0 if status is None else status.path_left_s


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
    except ShowError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
