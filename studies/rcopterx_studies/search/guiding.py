"""Guides the search to states that few flights have reached: those are flown again, varied."""

import random
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

from msgspec.structs import replace

from rcopterx_studies.search.flights import AFTER_S, FLOWN_S, TYPES, Flight, drawn_flight

VARIED: Final = 0.5  # share of flights that vary an earlier one, once there is one
MOVED_S: Final = 0.4  # standard deviation by which a happening of it is moved
KEPT: Final = 200  # flights that are varied, those with the rarest states


class Guide:
    """Draws flights; `visited` counts the flights that have reached a state or transition."""

    def __init__(self, vehicles: Sequence[int], types: Sequence[str] = TYPES) -> None:
        self._vehicles, self._types = vehicles, types
        self.visited: Counter[str] = Counter()
        self._flown: list[tuple[Flight, frozenset[str]]] = []

    def draw(self, seed: int) -> Flight:
        """Draw a flight: a new one, or an earlier one whose happenings are moved, replaced and added."""
        drawn = drawn_flight(seed, self._vehicles, self._types)
        chance = random.Random(-seed - 1)
        if not self._flown or chance.random() > VARIED:
            return drawn
        weights = [self._rarity(reached) for _, reached in self._flown]
        ((flight, _),) = chance.choices(self._flown, weights)
        return varied(flight, drawn, chance)

    def note(self, flight: Flight, visited: Mapping[str, int]) -> None:
        """Note what a flight has reached."""
        self.visited.update(visited.keys())
        self._flown.append((flight, frozenset(visited)))
        self._flown.sort(key=lambda one: self._rarity(one[1]), reverse=True)
        del self._flown[KEPT:]

    def _rarity(self, reached: frozenset[str]) -> float:
        """Large for a flight that has reached what few have."""
        return sum(1.0 / self.visited[state] ** 2 for state in reached)


def varied(flight: Flight, other: Flight, chance: random.Random) -> Flight:
    """Return a flight with its happenings at other times, some left out, and one of another flight."""
    up, *later = flight.happenings
    moved = [
        replace(one, at_s=max(0.0, round(chance.gauss(one.at_s, MOVED_S), 3)))
        for one in later
        if chance.random() < 0.9
    ]
    names = set(flight.vehicles)
    moved += [one for one in chance.sample(other.happenings[1:], 1) if not _strange(one.unit, other, names)]
    moved.sort(key=lambda one: one.at_s)
    ends_s = max((one.at_s for one in moved), default=0.0)
    return replace(flight, seed=other.seed, happenings=(up, *moved), seconds=max(FLOWN_S, ends_s + AFTER_S))


def _strange(unit: str, other: Flight, names: set[str]) -> bool:
    """Whether a happening may concern a vehicle that a fleet does not have."""
    return not set(other.vehicles) <= names and unit not in names
