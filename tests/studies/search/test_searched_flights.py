"""The first flights of the search, and those that broke a promise of a faulty product, keep all promises."""

from pathlib import Path

import pytest

from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.search.flights import PROMOTE, Flight, Happening, drawn_flight, read_flight
from rcopterx_studies.search.flying import fly

pytestmark = pytest.mark.timeout(600)
FOUND = sorted((Path(__file__).parents[2] / "found").glob("*.json"))


@pytest.mark.parametrize("seed", range(20))
def test_the_first_flights_keep_all_promises(seed: int) -> None:
    assert fly(drawn_flight(seed, vehicles=[1])).findings == []


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_a_flight_that_was_found_keeps_all_promises(path: Path) -> None:
    assert fly(read_flight(path)).findings == []


def test_a_request_that_raises_what_is_no_refusal_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(_: Fleet, name: str) -> list[str]:
        raise IndexError(name)

    monkeypatch.setattr(Fleet, "promote", failing)
    flight = Flight(1, ("coaxial",), "ideal", 50, 2.0, (Happening(0.5, PROMOTE, "v1"),))
    (finding,) = fly(flight).findings
    assert finding.promise == "exception"
    assert finding.text == "promote of v1: IndexError('v1')"
