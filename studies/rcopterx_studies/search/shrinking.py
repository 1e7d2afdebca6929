"""Reduces a flight that breaks a promise to one with less in it that still breaks it."""

from collections.abc import Callable, Iterator
from typing import Final

from msgspec.structs import replace

from rcopterx_studies.search.flights import Flight, Happening

MOST_TRIES: Final = 60
STILL: Final = "ideal"
AFTER_S: Final = 1.0  # shortest time after the last happening until all land


def shrunk(flight: Flight, breaks: Callable[[Flight], bool], tries: int = MOST_TRIES) -> Flight:
    """Return the smallest flight found that `breaks` the promise, within a number of flights."""
    while True:
        for smaller in _smaller(flight):
            if tries == 0:
                return flight
            tries -= 1
            if breaks(smaller):
                flight = smaller
                break
        else:
            return flight


def _smaller(flight: Flight) -> Iterator[Flight]:
    """Flights with less in them: the ones that leave out most come first."""
    happenings = flight.happenings
    size = len(happenings)
    while size := size // 2:
        for start in range(0, len(happenings), size):
            yield replace(flight, happenings=happenings[:start] + happenings[start + size :])
    if len(flight.types) > 1:
        *_, last = flight.vehicles
        left = tuple(each for one in happenings if (each := _without(one, last)) is not None)
        yield replace(flight, types=flight.types[:-1], happenings=left)
    ends_s = max((one.at_s for one in happenings), default=0.0) + AFTER_S
    if ends_s < flight.seconds:
        yield replace(flight, seconds=ends_s)
    if flight.weather != STILL:
        yield replace(flight, weather=STILL)


def _without(happening: Happening, vehicle: str) -> Happening | None:
    """A happening without a vehicle, None if it concerns that one."""
    fields = happening.fields
    if "names" in fields:
        names = [name for name in fields["names"] if name != vehicle]
        return replace(happening, fields=fields | {"names": names})
    named = [happening.unit, *(str(line) for key in ("faults", "following") for line in fields.get(key, ()))]
    return None if any(vehicle in text for text in named) else happening
