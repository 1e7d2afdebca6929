"""Ways of flying vehicles to places near the floor, clear of each other in time; free places on the floor.

The vehicles get their ways one after another. A way is a wait and straight legs, at rest in between, clear of
the ways that others have already and of the places where the rest hover. Hence all ways are clear of each
other, whatever the order. While nobody finds a way, a vehicle that stands in the way of others moves aside.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rcopterx.control.references.paths import KNOT_COLUMNS, PEAK_TO_MEAN_SPEED, FlightPath
from rcopterx.formation.placement import Room
from rcopterx.vehicles.state import Array

SPEED_M_S: Final = 0.7  # peaks on a leg, which every type of vehicle can fly
ACCELERATION_M_S2: Final = 0.8
PEAK_ACCELERATION: Final = 10 / math.sqrt(3)  # of a quintic from rest to rest, times duration^2 / distance
PERIOD_S: Final = 0.25  # between two samples, which straight lines connect
LONGEST_S: Final = 20.0  # until the last vehicle is above its place
PAUSE: Final = 2  # samples between two moments at which a way may begin
Flags = NDArray[np.bool_]
ABOVE_M: Final = 0.3  # height above the floor at which ways end
LEVELS: Final = 3  # heights of ways with several legs
ASIDE_M: Final = (-0.5, 0.5, -1.0, 1.0)  # distances from the straight way at which others lead
PARKING_M: Final = 0.4  # spacing of places for vehicles that move aside
MOST_ASIDE: Final = 12  # how often vehicles move aside
FREE_PLACES_M: Final = 0.1  # spacing of places that replace one that is taken


class _Traffic:
    """Where vehicles are at every sample, and how far they keep from each other.

    `half_axes_m`: of the ellipsoid around a vehicle, shape (3,), for pairs that do not begin or end nearer;
    those keep the least of these distances. Below `low_m` all heights count as `low_m`, so that a vehicle
    near the floor keeps the column below it.
    """

    def __init__(self, starts_m: Array, ends_m: Array, half_axes_m: Array, low_m: float) -> None:
        self._low_m = low_m
        samples = round(LONGEST_S / PERIOD_S) + 1
        self._tracks = np.repeat(self._raised(starts_m)[:, None], samples, axis=1)
        self._axes_m = np.empty((len(starts_m), len(starts_m), 3))
        for one, other in product(range(len(starts_m)), repeat=2):
            gaps = [self._raised(at)[one] - self._raised(at)[other] for at in (starts_m, ends_m)]
            near = min(float(np.linalg.norm(gap / half_axes_m)) for gap in gaps) < 1.0
            nearest_m = min(float(np.linalg.norm(gap)) for gap in gaps)
            self._axes_m[one, other] = min(nearest_m, half_axes_m.min()) if near else half_axes_m
        self._axes_m -= 1e-6

    def _raised(self, places_m: Array) -> Array:
        return np.concatenate((places_m[..., :2], np.maximum(places_m[..., 2:], self._low_m)), axis=-1)

    def beginning(self, index: int, way: FlightPath, begins: range) -> int | None:
        """Return the first of these samples at which a vehicle can begin a way that is clear, or None."""
        if not begins:
            return None
        steps = math.ceil(way.duration_s / PERIOD_S)
        places_m = self._raised(way.sample(PERIOD_S * np.arange(steps + 1.0))[:, :3])
        others = np.arange(len(self._tracks)) != index
        axes_m, tracks = self._axes_m[index, others][:, None, None], self._tracks[others]
        held = np.all(_clear(places_m[-1] - tracks, axes_m[:, 0]), axis=0)
        held = np.append(np.logical_and.accumulate(held[::-1])[::-1], True)  # also at the last sample
        windows = sliding_window_view(tracks, steps + 1, axis=1)[:, begins].swapaxes(2, 3)
        free: Flags = np.asarray(np.all(_clear(places_m - windows, axes_m), axis=(0, 2)))
        free &= held[np.array(begins) + steps]
        return begins[int(np.argmax(free))] if free.any() else None

    def add(self, index: int, way: FlightPath, begin: int) -> None:
        """Add a way, which begins at a sample, to the track of a vehicle."""
        at_s = PERIOD_S * np.arange(float(self._tracks.shape[1] - begin))
        self._tracks[index, begin:] = self._raised(way.sample(at_s)[:, :3])


def _clear(gaps_m: Array, axes_m: Array) -> Flags:
    """Whether lines between successive gaps, shape (.., k, 3), stay out of ellipsoids, shape (.., k - 1)."""
    gaps = gaps_m / axes_m
    begin, span = gaps[..., :-1, :], np.diff(gaps, axis=-2)
    share = np.clip(-_products(begin, span) / np.maximum(_products(span, span), 1e-12), 0.0, 1.0)
    nearest = begin + share[..., None] * span
    return np.asarray(_products(nearest, nearest) >= 1.0)


def _products(one: Array, other: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", one, other))


def ways_to(
    ends_m: Mapping[str, Array],
    present: Mapping[str, Array],
    standing_m: Sequence[Array],
    room: Room,
    half_axes_m: tuple[float, float],
) -> dict[str, FlightPath]:
    """Return ways from where vehicles hover, x y z yaw, to `ABOVE_M` above `ends_m`, x y z on the floor.

    All ways start at the same moment, and begin and end at rest. `standing_m`: places of other vehicles.
    `half_axes_m`: of the ellipsoid that a vehicle keeps clear, horizontal and vertical; where there is
    no room for it, vehicles keep the horizontal one in all directions. Vehicles without a way are left out.
    """
    ways: dict[str, FlightPath] = {}
    for upright_m in sorted(set(half_axes_m), reverse=True):
        if len(ways) < len(present):
            planner = _Planner(ends_m, present, standing_m, room, (half_axes_m[0], upright_m))
            ways = planner.ways()
    return ways


def free_places(
    homes_m: Mapping[str, Array], standing_m: Sequence[Array], room: Room, apart_m: float
) -> dict[str, Array]:
    """Return a place on the floor for each vehicle: its home, or the nearest free one if that is taken.

    Homes are taken by `standing_m`, or by a vehicle before, within the minimum distance of the room; other
    places are `apart_m` from all vehicles. Without a free place the vehicle is left out.
    """
    least_m = room.minimum_distance_m or 0.0
    places: dict[str, Array] = {}

    def clear(place_m: Array, by_m: float) -> bool:
        others = (*standing_m, *places.values())
        return all(math.dist(place_m[:2], other[:2]) >= by_m for other in others)

    for name, home_m in homes_m.items():
        if clear(home_m, least_m):
            places[name] = home_m
    x_m, y_m = (np.arange(room.min_m[axis], room.max_m[axis], FREE_PLACES_M) for axis in range(2))
    for name, home_m in homes_m.items():
        if name in places:
            continue
        others = np.array([(x, y, home_m[2]) for x in x_m for y in y_m if clear(np.array((x, y)), apart_m)])
        if len(others):
            places[name] = others[np.argmin(np.linalg.norm(others - home_m, axis=1))]
    return places


class _Planner:
    """Ways as far as they are known, by the times and places at which each vehicle is at rest."""

    def __init__(
        self,
        ends_m: Mapping[str, Array],
        present: Mapping[str, Array],
        standing_m: Sequence[Array],
        room: Room,
        half_axes_m: tuple[float, float],
    ) -> None:
        self._index = {name: number for number, name in enumerate(present)}
        self._rests = {name: [(0.0, place)] for name, place in present.items()}
        self._aims = {}
        for name, place in present.items():
            x, y, floor_m = ends_m[name]
            self._aims[name] = np.array([x, y, max(floor_m + ABOVE_M, room.min_m[2]), place[3]])
        low_m = max(float(aim[2]) for aim in self._aims.values())
        across_m, upright_m = half_axes_m
        self._traffic = _Traffic(
            np.array([*(place[:3] for place in present.values()), *standing_m]),
            np.array([*(aim[:3] for aim in self._aims.values()), *standing_m]),
            np.array([across_m, across_m, upright_m]),
            low_m,
        )
        self._low_m, self._high_m = np.array(room.min_m), np.array(room.max_m)
        self._levels_m = np.linspace(min(low_m + upright_m, room.max_m[2]), room.max_m[2], LEVELS)

    def ways(self) -> dict[str, FlightPath]:
        """Return the ways of all vehicles that can arrive, found for the furthest first."""
        aims, rests = self._aims, self._rests
        left = sorted(rests, key=lambda name: -math.dist(aims[name][:2], rests[name][0][1][:2]))
        for _ in range(MOST_ASIDE):
            waiting = [
                name for name in left if not self._go_on(name, self._ways(rests[name][-1][1], aims[name]))
            ]
            stuck, left = len(waiting) == len(left), waiting
            if not waiting or (stuck and not self._move_aside(waiting)):
                break
        return {name: _legs(rests[name]) for name in rests if name not in left}

    def _go_on(self, name: str, ways: Iterator[list[Array]]) -> bool:
        """Continue by the way that ends first; return whether one of them is clear."""
        rests, found, ends_s = self._rests[name], None, LONGEST_S
        earliest = math.ceil(rests[-1][0] / PERIOD_S)
        for places in ways:
            way = _timed([rests[-1][1], *places])
            duration_s, path = way[-1][0], _legs(way)
            begins = range(earliest, math.ceil((ends_s - duration_s) / PERIOD_S), PAUSE)
            begin = self._traffic.beginning(self._index[name], path, begins)
            if begin is not None:
                found, ends_s = (begin, way), begin * PERIOD_S + duration_s
        if found is None:
            return False
        begin, way = found
        self._traffic.add(self._index[name], _legs(way), begin)
        if begin * PERIOD_S > rests[-1][0] + 1e-6:
            rests.append((begin * PERIOD_S, rests[-1][1]))
        rests += [(begin * PERIOD_S + time_s, place) for time_s, place in way[1:]]
        return True

    def _ways(self, start: Array, aim: Array) -> Iterator[list[Array]]:
        """Yield the places of ways to an aim: straight, over it, and over places beside the straight way."""
        yield [aim]
        aside = np.array([start[1] - aim[1], aim[0] - start[0]])
        aside = aside / max(float(np.linalg.norm(aside)), 1e-6)
        for level_m in self._levels_m:
            up, over = np.copy(start), np.copy(aim)
            up[2] = over[2] = level_m
            yield [over, aim]
            yield [up, over, aim]
            for aside_m in ASIDE_M:
                beside = 0.5 * (start + aim)
                beside[:2] += aside_m * aside
                beside[2] = level_m
                beside[:3] = np.clip(beside[:3], self._low_m, self._high_m)
                yield [beside, over, aim]
                yield [up, beside, over, aim]

    def _move_aside(self, names: Sequence[str]) -> bool:
        """Let one of these vehicles move out of the way of the others; return whether one can."""
        here = {name: self._rests[name][-1][1] for name in names}
        x, y = (
            np.arange(low, high + 1e-6, PARKING_M)
            for low, high in zip(self._low_m[:2], self._high_m[:2], strict=True)
        )
        places = np.array([(*place, 0.0) for place in product(x, y, self._levels_m)])

        def clearance(name: str, at: Array) -> Array:
            """Distances of places, shape (k, 4), from the straight ways of the others."""
            others = [other for other in names if other != name]
            share = np.linspace(0.0, 1.0, 9)[:, None]
            lines = [here[other] + share * (self._aims[other] - here[other]) for other in others] or [
                np.full((1, 4), 1e3)
            ]
            gaps_m = at[:, None, :3] - np.vstack(lines)[None, :, :3]
            return np.asarray(np.linalg.norm(gaps_m, axis=-1).min(axis=1))

        for name in sorted(names, key=lambda name: float(clearance(name, here[name][None])[0])):
            worth = np.minimum(clearance(name, places), 0.6) - 0.2 * np.linalg.norm(
                places[:, :3] - here[name][:3], axis=1
            )
            for place in places[np.argsort(-worth)[:10]]:
                aim = np.append(place[:3], here[name][3])
                if self._go_on(name, iter(([aim],))):
                    return True
        return False


def _timed(places: Sequence[Array]) -> list[tuple[float, Array]]:
    """Return the times at which straight legs pass places, shape (4,); too short legs are left out."""
    rests = [(0.0, places[0])]
    for place in places[1:]:
        time_s, before = rests[-1]
        way_m = float(np.linalg.norm(place - before))
        if way_m > 1e-3:
            leg_s = max(
                PEAK_TO_MEAN_SPEED * way_m / SPEED_M_S,
                math.sqrt(PEAK_ACCELERATION * way_m / ACCELERATION_M_S2),
            )
            rests.append((time_s + leg_s, place))
    return rests if len(rests) > 1 else [*rests, (PERIOD_S, places[-1])]


def _legs(rests: Sequence[tuple[float, Array]]) -> FlightPath:
    """Return the path through places at which a vehicle is at rest."""
    knots = np.zeros((len(rests), KNOT_COLUMNS))
    for knot, (time_s, place) in zip(knots, rests, strict=True):
        knot[0], knot[1:5] = time_s, place
    return FlightPath(knots)
