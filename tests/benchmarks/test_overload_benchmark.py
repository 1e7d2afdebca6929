"""Promises of the overload benchmark: how large its fleet is, and what it says of a flight."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from rcopterx.benchmarks import overload
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Record, Recording
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS

Flown = list[int]


@pytest.fixture
def flown(monkeypatch: pytest.MonkeyPatch) -> Flown:
    """Sizes of the fleets that have flown; nothing flies."""
    sizes: Flown = []

    @contextmanager
    def in_formation(vehicles: int, _: int) -> Iterator[tuple[None, None]]:
        sizes.append(vehicles)
        yield None, None

    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(overload, "in_formation", in_formation)
    monkeypatch.setattr(overload, "_watched", lambda *_: {})
    return sizes


def test_fleets_start_until_one_is_too_large_by_the_factor(
    flown: Flown, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = {12: 11, 17: 9, 14: 10, 15: 10}
    monkeypatch.setattr(overload, "_served", lambda vehicles, _: served[vehicles])
    document = overload.run(1.5, 30, 60.0, lambda _: None)
    assert document == {"serves": 10, "vehicles": 15, "seconds": 60.0}
    assert flown == [15]


def test_measurement_that_keeps_changing_is_an_error(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overload, "_served", lambda vehicles, _: vehicles)
    with pytest.raises(FLIGHT_ERRORS, match=f"was different {overload.ATTEMPTS} times"):
        overload.run(1.1, 30, 60.0, lambda _: None)
    assert flown == []


def test_the_first_fleet_flies_where_it_is_too_large(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overload, "_served", lambda *_: 8)
    assert overload.run(1.5, 30, 60.0, lambda _: None)["vehicles"] == 12
    assert flown == [12]


def test_computer_too_fast_for_the_largest_fleet_is_an_error(
    flown: Flown, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(overload, "_served", lambda *_: 50)
    with pytest.raises(FLIGHT_ERRORS, match=r"1\.5 times what this computer serves are more than 63"):
        overload.run(1.5, 30, 60.0, lambda _: None)
    assert flown == []


def applied(frame: int, state: str) -> Applied:
    return Applied(
        state=state, input=(0.0, 0.0, 0.5, 0.0), pulse_width_us=(1500.0,) * 4, epoch=1, frame=frame,
        sequence=frame, fresh=True,
    )  # fmt: skip


def laboratory(frame: int, distance_m: float, touchdowns: int) -> LaboratoryState:
    vehicles = {
        name: LaboratoryVehicle(
            position_m=(x_m, 0.0, 1.0), yaw_rad=0.0, velocity_m_s=(0.0, 0.0, 0.0), on_floor=False,
            outside=False, touchdowns=touchdowns,
        )
        for name, x_m in (("h1", 0.0), ("h2", distance_m))
    }  # fmt: skip
    return LaboratoryState(frame=frame, sent_s=0.0, vehicles=vehicles)


def recording(distances_m: list[float], states: list[str], touchdowns: list[int]) -> Recording:
    records = []

    def add(unit: str, channel: channels.Channel[Any], message: Message) -> None:
        records.append(Record(unit, channel.topic, encode(message), 0.02 * len(records)))

    for frame, (distance_m, state, count) in enumerate(zip(distances_m, states, touchdowns, strict=True)):
        add(channels.SIMULATOR_UNIT, channels.LABORATORY, laboratory(frame, distance_m, count))
        add("h1", channels.APPLIED, applied(frame, "armed"))
        add("h2", channels.APPLIED, applied(frame, state))
    return Recording(records)


def verdict_of(flight: Recording) -> dict[str, Any]:
    return overload.verdict(FlightFigures(flight, ["h1", "h2"]), ["h1", "h2"])


def test_verdict_has_distances_held_vehicles_and_touchdowns() -> None:
    found = verdict_of(recording([0.75, 0.31, 0.6], ["armed", "hold", "hold"], [1, 1, 2]))
    assert found["closest_m"] == 0.31
    assert found["not_armed"] == {"h2": {"hold": 2}}
    assert found["touchdowns"] == 2


def test_a_flight_in_which_nothing_happened_says_so() -> None:
    found = verdict_of(recording([0.75, 0.7], ["armed", "armed"], [1, 1]))
    assert (found["not_armed"], found["touchdowns"], found["missed_ticks"]) == ({}, 0, 0)
