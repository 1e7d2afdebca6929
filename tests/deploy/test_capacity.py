"""Promises of measuring how many vehicles a computer flies."""

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.fleets import PAIR
from support.waiting import wait_for

from rcopterx.deploy import capacity
from rcopterx.deploy.capacity import CapacityMeasurement, vehicles_flown
from rcopterx.deploy.fleet_file.reading import parse_fleet


@given(
    control_s=st.floats(1e-5, 1.0),
    period_s=st.floats(1e-3, 0.1),
    processors=st.integers(1, 64),
    factor=st.integers(2, 5),
)
def test_faster_and_more_processors_fly_more(
    control_s: float, period_s: float, processors: int, factor: int
) -> None:
    flown = vehicles_flown(control_s, period_s, processors)
    assert vehicles_flown(control_s, period_s, factor * processors) >= factor * flown
    assert vehicles_flown(factor * control_s, period_s, processors) <= flown / factor


def measured(ready: bool = True) -> tuple[CapacityMeasurement, list[int | str]]:
    told: list[int | str] = []
    return CapacityMeasurement(parse_fleet(PAIR), "h2", lambda: ready, told.append), told


@pytest.mark.timeout(600)
def test_this_computer_flies_some_vehicles() -> None:
    measurement, told = measured()
    wait_for(lambda: bool(told), "nothing is told", deadline_s=500)
    measurement.stop()
    (flies,) = told
    assert isinstance(flies, int)


def test_a_measurement_that_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(capacity.sys, "executable", "/bin/false")
    measurement, told = measured()
    wait_for(lambda: bool(told), "nothing is told")
    measurement.stop()
    assert told == ["how many vehicles this computer flies cannot be measured: exit code 1"]


@pytest.mark.timeout(600)
def test_a_vehicle_that_cannot_be_built_says_why() -> None:
    told: list[int | str] = []
    fleet = parse_fleet(PAIR + 'control = { controller = "x" }')
    measurement = CapacityMeasurement(fleet, "h2", lambda: True, told.append)
    wait_for(lambda: bool(told), "nothing is told", deadline_s=500)
    measurement.stop()
    assert "no controller is called 'x'" in str(told[0])


@pytest.mark.parametrize("ready", [False, True])
def test_a_stopped_measurement_tells_nothing_and_leaves_nothing(ready: bool) -> None:
    measurement, told = measured(ready)
    measurement.stop()
    assert not told
    assert all(thread.name != "capacity" for thread in threading.enumerate())
