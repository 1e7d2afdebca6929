"""Ways of flying vehicles, clear of zones, and of each other in time; free places on the floor.

The vehicles get their ways one after another. A way is a wait and straight legs, at rest in between, clear of
the ways that others have already and of the places where the rest hover. Hence all ways are clear of each
other, whatever the order. While none is found, a vehicle moves aside, in case it stands in the way of others.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from rcopterx.control.references.paths import KNOT_COLUMNS, FlightPath, leg_time_s
from rcopterx.formation.placement import Room
from rcopterx.vehicles.state import Array

SPEED_M_S: Final = 0.7  # peaks on a leg, which every type of vehicle can fly
ACCELERATION_M_S2: Final = 0.8
PERIOD_S: Final = 0.25  # between two samples, which straight lines connect
LONGEST_S: Final = 20.0  # until the last vehicle is above its place
PAUSE: Final = 2  # samples between two moments at which a way may begin
ABOVE_M: Final = 0.3  # height above the floor at which ways end
LEVELS: Final = 3  # heights of ways with several legs
ASIDE_M: Final = (-1.0, -0.5, 0.0, 0.5, 1.0)  # distances from the straight way at which others lead
TRIES: Final = 3  # with other places aside, the same in every program
ROUNDS: Final = 30  # after each one without a new way, vehicles move aside
FREE_PLACES_M: Final = 0.1  # spacing of places that replace one that is taken


def ways_to(
    aims: Mapping[str, Array],
    present: Mapping[str, Array],
    standing_m: Sequence[Array],
    room: Room,
    half_axes_m: tuple[float, float],
) -> dict[str, FlightPath]:
    """Return ways from where vehicles hover to where they will, both x, y, z [m], yaw [rad].

    All ways start at the same moment, and begin and end at rest. `standing_m`: places of other vehicles.
    `half_axes_m`: of the ellipsoid that a vehicle keeps clear, horizontal and vertical. Vehicles without a
    way are left out.
    """
    starts, ends = np.array([*present.values()]), np.array([aims[name] for name in present])
    across_m, upright_m = half_axes_m
    axes_m, ways = np.array([across_m, across_m, upright_m]), dict[int, FlightPath]()
    for seed in range(TRIES):
        if len(ways) < len(present):
            ways = _Planner(starts, ends, standing_m, room, axes_m).ways(np.random.default_rng(seed))
    return {name: ways[index] for index, name in enumerate(present) if index in ways}


def above(ends_m: Mapping[str, Array], present: Mapping[str, Array], room: Room) -> dict[str, Array]:
    """Return where vehicles, x y z yaw, begin to land at places on the floor: `ABOVE_M` above these."""
    heights_m = {name: max(end_m[2] + ABOVE_M, room.min_m[2]) for name, end_m in ends_m.items()}
    return {name: np.array([*ends_m[name][:2], heights_m[name], at[3]]) for name, at in present.items()}


def free_places(
    homes_m: Mapping[str, Array], standing_m: Sequence[Array], room: Room, apart_m: float
) -> dict[str, Array]:
    """Return a place on the floor for each vehicle: its home, or the nearest free one if that is taken.

    Homes are taken by `standing_m`, or by a vehicle before, within the minimum distance of the room; other
    places are `apart_m` from all vehicles and homes; none is in or below a zone. Without a free place the
    vehicle is left out.
    """
    x_m, y_m = (np.arange(room.min_m[axis], room.max_m[axis], FREE_PLACES_M) for axis in range(2))
    places: dict[str, Array] = {}

    def free(choice_m: Array, others_m: Iterable[Array], by_m: float) -> Array:
        for other_m in others_m:
            choice_m = choice_m[np.linalg.norm(choice_m[:, :2] - other_m[:2], axis=1) >= by_m]
        over_m = np.array([0.0, 0.0, max(ABOVE_M, room.min_m[2])])
        return choice_m[[room.barred(np.array([at_m + over_m, at_m])) is None for at_m in choice_m]]

    for name, home_m in homes_m.items():
        taken_m = [*standing_m, *places.values()]
        choice_m = free(home_m[None], taken_m, room.minimum_distance_m or 0.0)
        if not len(choice_m):
            floor_m = np.array([*product(x_m, y_m, home_m[2:])])
            choice_m = free(floor_m, [*taken_m, *homes_m.values()], apart_m)
        if len(choice_m):
            places[name] = choice_m[np.argmin(np.linalg.norm(choice_m - home_m, axis=1))]
    return places


class _Planner:
    """Ways as far as they are found, and where vehicles are at every sample."""

    def __init__(
        self, starts: Array, aims: Array, standing_m: Sequence[Array], room: Room, half_axes_m: Array
    ) -> None:
        self._aims, self._low_m, self._high_m = aims, np.array(room.min_m), np.array(room.max_m)
        self._room = room
        self._rests = [[np.append(0.0, start)] for start in starts]
        # All lower heights count as this one, so that a vehicle near the floor keeps the column below it.
        self._floor_m = low_m = float(aims[:, 2].max())
        self._levels_m = np.linspace(min(low_m + half_axes_m[2], room.max_m[2]), room.max_m[2], LEVELS)
        begin_m, end_m = (self._raised(np.vstack((at[:, :3], *standing_m))) for at in (starts, aims))
        self._tracks = np.repeat(begin_m[:, None], round(LONGEST_S / PERIOD_S) + 1, axis=1)
        # Pairs that begin or end nearer than an ellipsoid keep the least of these distances.
        gaps_m = np.array([at[:, None] - at for at in (begin_m, end_m)])
        near = np.linalg.norm(gaps_m / half_axes_m, axis=-1).min(axis=0) < 1.0
        nearest_m = np.minimum(np.linalg.norm(gaps_m, axis=-1).min(axis=0), half_axes_m.min())
        self._axes_m = np.where(near[..., None], nearest_m[..., None], half_axes_m) - 1e-6

    def _raised(self, places_m: Array) -> Array:
        return np.maximum(places_m, (-np.inf, -np.inf, self._floor_m))

    def ways(self, rng: np.random.Generator) -> dict[int, FlightPath]:
        """Return the ways of all vehicles that can arrive, found for the furthest first."""
        far_m = np.linalg.norm(self._aims[:, :2] - [rests[0][1:3] for rests in self._rests], axis=1)
        left = [int(index) for index in np.argsort(far_m)[::-1]]
        for _ in range(ROUNDS):
            waiting = [index for index in left if not self._go_on(index, self._ways(index))]
            if len(waiting) == len(left):
                any(self._go_on(index, [self._somewhere(index, rng)]) for index in rng.permutation(left))
            left = waiting
        return {index: _path(rests) for index, rests in enumerate(self._rests) if index not in left}

    def _ways(self, index: int) -> Iterator[list[Array]]:
        """Yield the places of ways to an aim: straight, and up and over places beside the straight way.

        Where there are zones, also all the way beside the straight one.
        """
        start, aim = self._rests[index][-1][1:], self._aims[index]
        yield [aim]
        aside = np.array([start[1] - aim[1], aim[0] - start[0]])
        aside = aside / max(float(np.linalg.norm(aside)), 1e-6)
        for level_m, aside_m in product(self._levels_m, ASIDE_M):
            up, over = np.copy(start), np.copy(aim)
            up[2] = over[2] = level_m
            if not aside_m:
                yield [up, over, aim]
                continue
            shift_m = aside_m * aside
            yield [up, self._beside(0.5 * (up + over), shift_m), over, aim]
            if self._room.zones:
                yield [up, self._beside(up, shift_m), self._beside(over, shift_m), over, aim]

    def _beside(self, place: Array, shift_m: Array) -> Array:
        """Return a place moved horizontally, within the volume."""
        x_m, y_m = np.clip(place[:2] + shift_m, self._low_m[:2], self._high_m[:2])
        return np.array([x_m, y_m, *place[2:]])

    def _somewhere(self, index: int, rng: np.random.Generator) -> list[Array]:
        """Return a random place, above the aims, to which a vehicle may move out of the way of others."""
        low_m = (*self._low_m[:2], self._levels_m[0])
        return [np.append(rng.uniform(low_m, self._high_m), self._aims[index, 3])]

    def _go_on(self, index: int, ways: Iterable[list[Array]]) -> bool:
        """Continue by the way that ends first; return whether one of them is clear."""
        rests, ends_s = self._rests[index], LONGEST_S
        found: tuple[list[Array], Array, int] | None = None
        others = np.arange(len(self._tracks)) != index
        axes_m, tracks = self._axes_m[index, others][:, None], self._tracks[others]
        for places in ways:
            way = _timed([rests[-1][1:], *places])
            last = math.ceil((ends_s - way[-1][0]) / PERIOD_S)
            track = _path(way).sample(PERIOD_S * np.arange(float(tracks.shape[1])))[:, :3]
            if self._room.barred(track) is not None:
                continue
            track = self._raised(track)
            for begin in range(math.ceil(rests[-1][0] / PERIOD_S), last, PAUSE):
                if _clear(track[: len(track) - begin] - tracks[:, begin:], axes_m):
                    found, ends_s = (way, track, begin), begin * PERIOD_S + way[-1][0]
                    break
        if found is None:
            return False
        way, track, begin = found
        self._tracks[index, begin:] = track[: len(track) - begin]
        for rest in way:
            rest[0] += begin * PERIOD_S
        rests += way if way[0][0] > rests[-1][0] + 1e-6 else way[1:]
        return True


def _clear(gaps_m: Array, axes_m: Array) -> bool:
    """Whether lines between successive gaps, shape (n, k, 3), stay out of ellipsoids, shape (n, 1, 3)."""
    gaps = gaps_m / axes_m
    begin, span = gaps[:, :-1], np.diff(gaps, axis=1)
    share = -np.sum(begin * span, axis=-1) / np.maximum(np.sum(span * span, axis=-1), 1e-12)
    nearest = begin + np.clip(share, 0.0, 1.0)[..., None] * span
    return bool(np.all(np.sum(nearest * nearest, axis=-1) >= 1.0))


def _timed(places: Sequence[Array]) -> list[Array]:
    """Return rows of the times at which straight legs pass places, and these; too short legs are left out."""
    rests = [np.append(0.0, places[0])]
    for place in places[1:]:
        way_m = float(np.linalg.norm(place - rests[-1][1:]))
        if way_m > 1e-3 or place is places[-1]:
            leg_s = max(leg_time_s(way_m, SPEED_M_S, ACCELERATION_M_S2), PERIOD_S)
            rests.append(np.append(rests[-1][0] + leg_s, place))
    return rests


def _path(rests: Sequence[Array]) -> FlightPath:
    """Return the path through places at which a vehicle is at rest."""
    knots = np.zeros((len(rests), KNOT_COLUMNS))
    knots[:, :5] = rests
    return FlightPath(knots)
