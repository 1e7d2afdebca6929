"""When a vehicle on its way down counts as standing: never in the air, soon on the floor or anything else."""

import pytest

from rcopterx.transmitter_gateway.landing import Motion
from rcopterx.transmitter_gateway.touchdown import (
    AT_FLOOR_M,
    AT_FLOOR_S,
    LIGHT,
    LIGHT_S,
    STILL_M_S,
    Touchdown,
)

FLOOR_M = 0.25
EDGE = 1e-6


def seen(height_m: float, climb_m_s: float = 0.0) -> Motion:
    return Motion((1.0, 2.0, FLOOR_M + height_m), (5.0, 5.0, climb_m_s), 0.0)


def stands_after_s(motion: Motion, missing_thrust: float, limit_s: float = 2.0) -> float | None:
    """When the vehicle counts as standing if it stays as it is."""
    watch = Touchdown()
    for step in range(round(limit_s / 0.01)):
        if watch.happened(motion, FLOOR_M, missing_thrust, 10.0 + step * 0.01):
            return step * 0.01
    return None


@pytest.mark.parametrize("climb_m_s", [0.0, STILL_M_S - EDGE, -STILL_M_S + EDGE])
def test_vehicle_at_the_floor_that_neither_climbs_nor_sinks_stands(climb_m_s: float) -> None:
    assert stands_after_s(seen(AT_FLOOR_M - EDGE, climb_m_s), 0.0) == pytest.approx(AT_FLOOR_S, abs=0.011)
    assert stands_after_s(seen(-0.05, climb_m_s), 0.0) == pytest.approx(AT_FLOOR_S, abs=0.011)


@pytest.mark.parametrize(
    ("height_m", "climb_m_s", "missing"),
    [
        (AT_FLOOR_M, 0.0, LIGHT),
        (AT_FLOOR_M - EDGE, STILL_M_S, LIGHT + EDGE),
        (AT_FLOOR_M - EDGE, -STILL_M_S, LIGHT + EDGE),
        (1.0, 0.0, LIGHT),
        (1.0, -0.4, LIGHT + EDGE),
    ],
    ids=["above the floor", "climbs", "sinks", "has thrust", "descends"],
)
def test_vehicle_in_the_air_does_not_stand(height_m: float, climb_m_s: float, missing: float) -> None:
    assert stands_after_s(seen(height_m, climb_m_s), missing) is None


def test_vehicle_that_does_not_sink_with_little_thrust_stands_on_something() -> None:
    assert stands_after_s(seen(0.7), LIGHT + EDGE) == pytest.approx(LIGHT_S, abs=0.011)


def test_times_begin_anew_when_the_vehicle_moves() -> None:
    watch = Touchdown()
    assert not watch.happened(seen(0.0), FLOOR_M, LIGHT + EDGE, 0.0)
    assert not watch.happened(seen(0.0, -0.3), FLOOR_M, LIGHT + EDGE, AT_FLOOR_S - 0.01)
    assert not watch.happened(seen(0.0), FLOOR_M, LIGHT + EDGE, LIGHT_S)
    assert not watch.happened(seen(0.0), FLOOR_M, LIGHT + EDGE, LIGHT_S + AT_FLOOR_S - 0.01)
    assert watch.happened(seen(0.0), FLOOR_M, LIGHT + EDGE, LIGHT_S + AT_FLOOR_S)


def test_released_watch_begins_anew() -> None:
    watch = Touchdown()
    watch.happened(seen(0.0), FLOOR_M, 1.0, 0.0)
    watch.release()
    assert not watch.happened(seen(0.0), FLOOR_M, 1.0, 10.0)
