"""Promises of drawn flights: their fleets can be flown, they are kept as files, and shrink."""

import random
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import convert
from msgspec.structs import replace

from rcopterx.bus.requests import VERBS, Inject
from rcopterx.simulator.faults import timed_faults
from rcopterx_studies.search.flights import (
    END,
    OWN_VERBS,
    UP,
    Flight,
    Happening,
    drawn_flight,
    read_flight,
)
from rcopterx_studies.search.flying import impaired
from rcopterx_studies.search.guiding import Guide, varied
from rcopterx_studies.search.shrinking import shrunk
from rcopterx_studies.search.watch import excuses_of


@pytest.mark.parametrize("seed", range(40))
def test_every_drawn_flight_has_a_valid_fleet_and_valid_requests(seed: int) -> None:
    flight = drawn_flight(seed, vehicles=range(1, 7))
    file = flight.file(port=20000)
    assert tuple(file.vehicles) == flight.vehicles
    assert file.clock.lockstep
    assert flight.happenings[0].verb == UP
    for happening in flight.happenings:
        if happening.verb in OWN_VERBS:
            continue
        request = convert(happening.fields, VERBS[happening.verb].request)
        if isinstance(request, Inject):
            assert timed_faults(request.faults)


def test_a_seed_draws_the_same_flight_again_and_another_one_another() -> None:
    assert drawn_flight(7) == drawn_flight(7) != drawn_flight(8)


def test_a_flight_is_the_same_after_it_was_kept_in_a_file(tmp_path: Path) -> None:
    flight = drawn_flight(3)
    flight.save(tmp_path / "flight.json")
    assert read_flight(tmp_path / "flight.json") == flight


def test_a_file_with_an_unknown_field_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.json"
    path.write_text('{"seeds": 1}')
    with pytest.raises(msgspec.ValidationError):
        read_flight(path)


def test_shrinking_leaves_what_breaks_the_promise_and_nothing_else() -> None:
    cause = Happening(2.0, "land", "v1")
    flight = replace(
        drawn_flight(11, vehicles=[3]),
        happenings=(*(Happening(float(at_s), "lead", f"v{1 + at_s % 3}") for at_s in range(11)), cause),
    )

    def breaks(one: Flight) -> bool:
        return cause in one.happenings and len(one.types) >= 2

    small = shrunk(flight, breaks)
    assert small.happenings == (cause,)
    assert len(small.types) == 2
    assert (small.weather, small.seconds) == ("ideal", 3.0)


def test_shrinking_ends_after_its_number_of_flights() -> None:
    flown = []
    shrunk(drawn_flight(5, vehicles=[3]), lambda one: bool(flown.append(one)), tries=4)
    assert len(flown) == 4


def test_only_vehicles_that_a_flight_breaks_are_excused() -> None:
    fault = {"kind": "break_radio", "vehicle": "v2", "condition": "off"}
    flight = replace(
        drawn_flight(5, vehicles=[3]),
        happenings=(
            Happening(1.0, "inject", "simulator", {"faults": [{"at_s": 0.0, "fault": fault}]}),
            Happening(2.0, END, "transmitters"),
        ),
    )
    assert set(excuses_of(flight)) == {"v2"}


def test_impaired_messages_are_lost_doubled_and_late_until_the_time_is_over() -> None:
    travel = impaired(random.Random(1), 4.0, {"seconds": 6.0, "lost": 0.2, "doubled": 0.2, "late_s": 0.05})
    arrivals = [travel(5.0) for _ in range(1000)]
    copies = [len(times_s) for times_s in arrivals]
    assert {0, 1, 2} == set(copies)
    assert 150 < copies.count(0) < 250
    assert all(5.0 <= time_s <= 5.05 for times_s in arrivals for time_s in times_s)
    assert travel(10.5) == (10.5,)


def test_what_was_seldom_reached_is_flown_again_varied() -> None:
    guide = Guide([2])
    rare, usual = drawn_flight(1, [2]), drawn_flight(2, [2])
    for _ in range(50):
        guide.note(usual, {"armed": 9})
    guide.note(rare, {"armed": 9, "armed > killed": 1})
    flights = [guide.draw(seed) for seed in range(100, 200)]
    assert flights == [guide.draw(seed) for seed in range(100, 200)]
    new = [drawn_flight(seed, [2]) for seed in range(100, 200)]
    others = [flight for flight in flights if flight not in new]
    assert 30 < len(others) < 70
    ups = [flight.happenings[0] for flight in others]
    assert ups.count(rare.happenings[0]) > ups.count(usual.happenings[0])


@given(st.integers(0, 1000), st.integers(0, 1000), st.integers(0, 1000))
def test_a_varied_flight_can_be_flown(one: int, other: int, seed: int) -> None:
    flight = varied(drawn_flight(one, [1, 2, 3]), drawn_flight(other, [1, 2, 3]), random.Random(seed))
    times_s = [happening.at_s for happening in flight.happenings]
    assert times_s == sorted(times_s)
    assert flight.seconds > times_s[-1]
    strange = {f"v{number}" for number in range(1, 7)} - set(flight.vehicles)
    assert not any(name in str(msgspec.to_builtins(flight.happenings)) for name in strange)
