"""When a vehicle on its way down counts as standing: never in the air, soon on the floor or anything else."""

import pytest

from rcopterx.transmitter_gateway.landing import (
    AT_FLOOR_M,
    AT_FLOOR_S,
    STILL_M,
    STILL_M_S,
    STILL_S,
    Motion,
    Touchdown,
)

FLOOR_M = 0.25
PERIOD_S = 0.01
EDGE = 1e-6


def seen(height_m: float, climb_m_s: float = 0.0) -> Motion:
    return Motion((1.0, 2.0, FLOOR_M + height_m), (5.0, 5.0, climb_m_s), 0.0)


def stands_after_s(motion: Motion, limit_s: float = 5.0) -> float | None:
    """When the vehicle counts as standing if it stays as it is."""
    watch = Touchdown()
    for step in range(round(limit_s / PERIOD_S)):
        if watch.happened(motion, FLOOR_M, 10.0 + step * PERIOD_S):
            return step * PERIOD_S
    return None


@pytest.mark.parametrize("climb_m_s", [0.0, STILL_M_S - EDGE, -STILL_M_S + EDGE])
@pytest.mark.parametrize("height_m", [AT_FLOOR_M - EDGE, -0.05])
def test_vehicle_at_the_floor_that_neither_climbs_nor_sinks_stands(height_m: float, climb_m_s: float) -> None:
    assert stands_after_s(seen(height_m, climb_m_s)) == pytest.approx(AT_FLOOR_S, abs=0.011)


def test_vehicle_that_stays_still_above_the_floor_stands_on_something() -> None:
    assert stands_after_s(seen(0.7)) == pytest.approx(STILL_S, abs=0.011)
    assert stands_after_s(seen(AT_FLOOR_M)) == pytest.approx(STILL_S, abs=0.011)


@pytest.mark.parametrize("climb_m_s", [STILL_M_S, -STILL_M_S])
@pytest.mark.parametrize("height_m", [-0.05, 0.7])
def test_vehicle_that_climbs_or_sinks_does_not_stand(height_m: float, climb_m_s: float) -> None:
    assert stands_after_s(seen(height_m, climb_m_s)) is None


def test_vehicle_that_sinks_slowly_in_the_air_does_not_stand() -> None:
    watch = Touchdown()
    for step in range(1000):
        assert not watch.happened(seen(2.0 - 0.08 * step * PERIOD_S, -0.08), FLOOR_M, step * PERIOD_S)


def test_times_begin_anew_when_the_vehicle_moves() -> None:
    watch = Touchdown()
    assert not watch.happened(seen(0.0), FLOOR_M, 0.0)
    assert not watch.happened(seen(0.0, -0.3), FLOOR_M, AT_FLOOR_S - 0.01)
    assert not watch.happened(seen(0.0), FLOOR_M, 0.5)
    assert not watch.happened(seen(0.0), FLOOR_M, 0.5 + AT_FLOOR_S - 0.01)
    assert watch.happened(seen(0.0), FLOOR_M, 0.5 + AT_FLOOR_S)
    assert not watch.happened(seen(0.7), FLOOR_M, 1.0)
    assert not watch.happened(seen(0.7 + STILL_M + EDGE), FLOOR_M, STILL_S)
    assert not watch.happened(seen(0.7 + STILL_M), FLOOR_M, 1.0 + STILL_S)
    assert watch.happened(seen(0.7 + STILL_M), FLOOR_M, 2.0 * STILL_S)


def test_bounce_is_no_landing() -> None:
    watch = Touchdown()
    for step in range(300):
        t = step * PERIOD_S % 0.3
        bouncing = seen(1.5 * t - 0.5 * 9.81 * t * t, 1.5 - 9.81 * t)
        assert not watch.happened(bouncing, FLOOR_M, step * PERIOD_S)


def test_released_watch_begins_anew() -> None:
    watch = Touchdown()
    watch.happened(seen(0.0), FLOOR_M, 0.0)
    watch.release()
    assert not watch.happened(seen(0.0), FLOOR_M, 10.0)
