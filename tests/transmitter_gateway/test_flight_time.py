"""Promises of the remaining flight time: shown when it is known, it shrinks and has the true one within."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.battery import BatteryLimits
from rcopterx.simulator.crazyflie import battery_voltage_v
from rcopterx.transmitter_gateway.battery import (
    CAPACITY_ERROR,
    CELL_V,
    CHARGE_ERROR,
    LAST_SHARE,
    POWER_OF_THRUST,
    BatteryWatch,
    flight_left_s,
)

HOVER_S = 400.0
LIMITS = BatteryLimits(warn_v=3.2, land_v=3.0, full_v=4.2, hover_s=HOVER_S)
HOVER = (0.0, 0.0, 0.5, 0.0)
VOLTAGES = st.floats(2.0, 4.3)
TIMES_S = st.floats(0.0, 2000.0)


def left_s(rest_v: float, used_s: float = 0.0, limits: BatteryLimits = LIMITS) -> tuple[float, float]:
    found = flight_left_s(limits, rest_v, used_s)
    assert found is not None
    return found


def watched(rest_v: float | None, limits: BatteryLimits = LIMITS) -> BatteryWatch:
    """A vehicle that has stood with this voltage, and takes off at 0 s."""
    watch = BatteryWatch(limits, hover_thrust=0.5)
    for now_s in (-1.0, 0.0):
        watch.observe(rest_v, now_s, there=True, flying=False)
    return watch


def shown(watch: BatteryWatch) -> tuple[float, float] | None:
    assert watch.status is not None
    return watch.status.left_s


@given(VOLTAGES, VOLTAGES, TIMES_S, TIMES_S)
def test_a_higher_voltage_before_the_flight_is_no_less_time_and_use_shortens_it(
    one_v: float, other_v: float, used_s: float, more_s: float
) -> None:
    lower, higher = (left_s(each_v, used_s) for each_v in sorted((one_v, other_v)))
    assert 0.0 <= lower[0] <= higher[0] <= higher[1]
    assert lower[1] <= higher[1]
    after = left_s(one_v, used_s + more_s)
    for before_s, after_s in zip(left_s(one_v, used_s), after, strict=True):
        assert after_s <= before_s <= after_s + more_s + 1e-9


@given(
    st.floats(1.0 - CAPACITY_ERROR, 1.0 + CAPACITY_ERROR),
    st.integers(0, 10),
    st.floats(-CHARGE_ERROR, CHARGE_ERROR),
    st.floats(0.0, 1.0),
)
def test_the_true_time_is_within_for_cells_that_differ_from_the_table_as_assumed(
    capacity: float, tenths: int, error: float, flown: float
) -> None:
    full_s = min(max(tenths / 10 + error, 0.0), 1.0) * capacity * HOVER_S
    shortest_s, longest_s = left_s(CELL_V[tenths], flown * full_s)
    assert shortest_s - 1e-6 <= (1.0 - flown) * full_s <= longest_s + 1e-6


@given(VOLTAGES, st.integers(1, 6))
def test_batteries_of_several_cells_are_judged_by_the_voltage_of_a_full_one(
    cell_v: float, cells: int
) -> None:
    limits = BatteryLimits(full_v=4.2 * cells, hover_s=HOVER_S)
    assert left_s(cells * cell_v, 10.0, limits) == pytest.approx(left_s(cell_v, 10.0))


@given(st.floats(0.0, 2.0), st.integers(1, 200))
def test_more_thrust_uses_more(thrust: float, seconds: int) -> None:
    watch = watched(4.2)
    for now_s in range(1, seconds + 1):
        watch.observe(3.7, float(now_s), there=True, flying=True, u=(0.0, 0.0, 0.5 * thrust, 0.0))
    assert shown(watch) == pytest.approx(left_s(4.2, seconds * thrust**POWER_OF_THRUST))


@pytest.mark.parametrize(
    ("limits", "rest_v"),
    [(BatteryLimits(3.2, 3.0, 4.2), 4.2), (BatteryLimits(hover_s=HOVER_S), 4.2), (LIMITS, None)],
    ids=["no flight time of the type", "no full voltage", "no voltage before the take-off"],
)
def test_nothing_is_predicted_where_something_is_unknown(limits: BatteryLimits, rest_v: float | None) -> None:
    watch = watched(rest_v, limits)
    watch.observe(3.7, 1.0, there=True, flying=True, u=HOVER)
    assert shown(watch) is None


def test_a_flight_that_an_earlier_process_began_has_no_prediction_and_the_next_one_has() -> None:
    watch = BatteryWatch(LIMITS, hover_thrust=0.5)
    for now_s in (5000.0, 5001.0):
        watch.observe(3.7, now_s, there=True, flying=True, u=HOVER)
        assert shown(watch) is None
    watch.observe(4.2, 5100.0, there=True, flying=False)
    watch.observe(3.8, 5101.0, there=True, flying=True, u=HOVER)
    assert shown(watch) == pytest.approx(left_s(4.2, 1.0))


@pytest.mark.parametrize("capacity", [0.75, 0.9, 1.0, 1.1])
@pytest.mark.parametrize("charge", [1.0, 0.95])
def test_the_flight_of_a_simulated_battery_ends_within_the_predicted_times(
    capacity: float, charge: float
) -> None:
    """A cell of another kind than that of the table flies until the gateway would land it."""
    used = [1.0 - charge + now_s / (capacity * HOVER_S) for now_s in range(int(1.2 * HOVER_S))]
    voltages_v = [battery_voltage_v(min(share, 1.0), 1.0) for share in used]
    lands_s = next(now_s for now_s, voltage_v in enumerate(voltages_v) if voltage_v < 3.0)
    watch = watched(battery_voltage_v(1.0 - charge, 0.0))
    for now_s in range(1, lands_s):
        watch.observe(voltages_v[now_s], float(now_s), there=True, flying=True, u=HOVER)
        found = shown(watch)
        assert found is not None
        if abs(capacity - 1.0) <= CAPACITY_ERROR:
            assert found[0] - 10.0 <= lands_s - now_s <= found[1] + 10.0
    assert found is not None
    assert found[0] == 0.0
    assert found[1] <= LAST_SHARE * HOVER_S, "a weak voltage under load shows the end, whatever the capacity"
