"""A serial port that is away for a moment while its vehicle flies."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from restart_bench import Restart

from rcopterx.simulator.radio_receiver import ReceiverState
from rcopterx.transmitter_gateway.inputs import Action, LinkState, State
from rcopterx.transmitter_gateway.transmitter import REPOWERED_S

LOW_US = 1100


def away(bench: Restart, seconds: float, thrust: float | None = 0.55) -> None:
    """Let the adapter fail in flight, and return with a module that has kept its power."""
    bench.lose_adapter()
    bench.run(seconds, thrust)
    bench.radio.replug(bench.now_s)


@pytest.mark.parametrize("seconds", [0.04, 0.1, 0.4])
def test_vehicle_is_flown_on_when_its_port_returns_in_time(restart: Restart, seconds: float) -> None:
    restart.fly()
    armed = restart.counters["entered ARMED"]
    away(restart, seconds)
    states = restart.run(1.0)
    assert restart.state is State.ARMED
    assert restart.transmitter.arbiter.leases.commanding == 1
    assert (restart.counters["entered ARMED"], restart.counters["entered DISARMED"]) == (armed, 0)
    assert restart.counters["flights continued after the port was away"] == 1
    assert min(restart.throttle_us()) > 1480
    assert ReceiverState.FAILSAFE not in states


def test_vehicle_without_commands_is_landed_on_when_its_port_returns(restart: Restart) -> None:
    restart.fly()
    away(restart, 0.4, thrust=None)
    restart.run(0.2, thrust=None)
    assert restart.state is State.LAND
    assert min(restart.throttle_us()) > 1450


def test_port_that_is_away_is_shown_and_no_frame_counts_as_written(restart: Restart) -> None:
    restart.fly()
    restart.lose_adapter()
    restart.run(0.1)
    written_s = restart.page.last.written_s if restart.page.last is not None else None
    restart.run(0.3)
    assert restart.transmitter.arbiter.state is State.ARMED
    assert restart.transmitter.link(restart.now_s).state is LinkState.LOST
    assert restart.transmitter.link(restart.now_s).text.startswith("cannot open")
    assert restart.page.last is not None
    assert (restart.page.last.state, restart.page.last.written_s) == (State.ARMED, written_s)


def test_vehicle_whose_port_returns_too_late_stays_disarmed(restart: Restart) -> None:
    restart.fly()
    away(restart, 3.0)
    restart.run(1.0)
    assert restart.state is State.DISARMED
    assert restart.transmitter.arbiter.reason.startswith("serial link lost: cannot open")
    assert set(map(round, restart.throttle_us())) == {LOW_US}


def test_flight_ends_by_time_alone_while_the_port_stays_away(restart: Restart) -> None:
    restart.fly()
    restart.lose_adapter()
    restart.run(0.66)
    assert restart.state is State.ARMED
    restart.run(0.06)
    assert restart.state is State.DISARMED


def test_vehicle_that_is_on_the_floor_when_its_port_returns_is_disarmed(restart: Restart) -> None:
    restart.fly()
    restart.lose_adapter()
    restart.sinks_m_s = 2.0
    restart.run(0.5)
    restart.radio.replug(restart.now_s)
    restart.run(1.0)
    assert restart.state is State.DISARMED
    assert restart.transmitter.arbiter.reason == "serial link lost: it may stand on the floor"
    assert set(map(round, restart.throttle_us())) == {LOW_US}


def test_vehicle_that_lands_and_is_on_the_floor_when_its_port_returns_is_disarmed(restart: Restart) -> None:
    restart.fly()
    restart.run(0.4, thrust=None)
    assert restart.state is State.LAND
    restart.lose_adapter()
    restart.sinks_m_s = 2.0
    restart.run(0.5, thrust=None)
    restart.radio.replug(restart.now_s)
    restart.run(0.3, thrust=None)
    assert restart.state is State.DISARMED
    assert restart.transmitter.arbiter.reason == "serial link lost: it may stand on the floor"
    # The status of its module is requested again.
    assert restart.transmitter.link(restart.now_s).state is LinkState.UP


def test_every_continued_flight_is_counted(restart: Restart) -> None:
    restart.fly()
    for _ in range(2):
        away(restart, 0.1)
        restart.run(1.0)
    assert restart.counters["flights continued after the port was away"] == 2


def test_vehicle_that_was_armed_on_the_floor_is_disarmed(restart: Restart) -> None:
    restart.height_m = 0.02
    restart.run(1.5, thrust=0.0)
    assert restart.request(Action.ARM).accepted
    restart.run(0.1, thrust=0.0)
    away(restart, 0.1, thrust=0.0)
    restart.run(1.0, thrust=0.0)
    assert restart.state is State.DISARMED
    assert restart.request(Action.ARM).accepted


def test_kill_while_the_port_is_away_is_written_when_it_returns(restart: Restart) -> None:
    restart.fly()
    restart.lose_adapter()
    restart.run(0.1)
    restart.request(Action.KILL)
    restart.run(0.1)
    restart.radio.replug(restart.now_s)
    restart.run(0.5)
    assert restart.state is State.KILLED
    assert set(map(round, restart.throttle_us())) == {LOW_US}


@pytest.mark.parametrize(("silence_s", "state"), [(0.1, State.ARMED), (0.5, State.DISARMED)])
def test_successor_of_a_gateway_whose_port_was_away_judges_by_the_last_written_frame(
    restart: Restart, silence_s: float, state: State
) -> None:
    restart.fly()
    restart.lose_adapter()
    restart.run(0.3)
    restart.radio.replug(restart.now_s)
    restart.die(silence_s)
    restart.run(0.5)
    assert restart.state is state


@pytest.fixture
def slow(tmp_path: Path) -> Iterator[Restart]:
    """A radio whose receiver needs as long as real ones to find a module that lost its power."""
    bench = Restart(tmp_path / "h1", connect_s=2.0)
    yield bench
    bench.transmitter.port.close()
    bench.radio.unplug()


def test_fallen_vehicle_gets_no_thrust_when_its_module_has_lost_power_and_is_received_again(
    slow: Restart,
) -> None:
    slow.run(3.0, thrust=0.0)
    slow.fly()
    slow.radio.unplug()
    slow.run(0.4)
    slow.radio.replug(slow.now_s)
    slow.run(0.7, thrust=0.8)
    assert slow.state is State.ARMED
    slow.sinks_m_s = 2.4
    states = slow.run(0.4, thrust=0.8)
    assert states[-1] is ReceiverState.FAILSAFE
    assert slow.state is State.DISARMED
    slow.throttle_us()
    states = slow.run(REPOWERED_S, thrust=0.8)
    assert states[-1] is ReceiverState.LINKED
    assert set(map(round, slow.throttle_us())) == {LOW_US}


def test_vehicle_that_was_disarmed_on_the_floor_after_its_port_returned_can_be_armed_at_once(
    restart: Restart,
) -> None:
    restart.fly()
    away(restart, 0.1)
    restart.sinks_m_s = 2.0
    restart.run(0.7)
    assert restart.state is State.DISARMED
    assert restart.transmitter.arbiter.reason == "serial link lost: it may stand on the floor"
    restart.run(1.0, thrust=0.0)
    assert restart.request(Action.ARM).accepted
    restart.run(0.5, thrust=0.0)
    assert restart.state is State.ARMED


def test_vehicle_that_flies_low_long_after_its_port_returned_stays_armed(restart: Restart) -> None:
    restart.fly()
    away(restart, 0.1)
    restart.run(REPOWERED_S)
    restart.sinks_m_s = 1.0
    restart.run(1.0)
    assert restart.state is State.ARMED


SILENCES = st.lists(
    st.tuples(st.sampled_from([0.0, 0.06, 0.2, 0.4, 0.8]), st.sampled_from([0.0, 0.06, 0.2, 0.8])),
    min_size=1,
    max_size=3,
)
REOPENED_S = 0.17
"""Longest time from the return of an adapter until it is opened."""


@settings(max_examples=5, deadline=None)
@given(silences=SILENCES)
def test_vehicle_is_flown_on_after_short_silences_and_gets_no_thrust_after_a_long_one(
    silences: list[tuple[float, float]],
) -> None:
    """Each silence: the adapter is away, then the gateway is killed and replaced after a while."""
    with TemporaryDirectory() as directory:
        bench = Restart(Path(directory) / "h1")
        bench.fly()
        for away_s, dead_s in silences:
            bench.lose_adapter()
            bench.run(away_s)
            bench.radio.replug(bench.now_s)
            if dead_s:
                bench.die(dead_s)
            bench.run(0.5)
            throttles_us = bench.throttle_us()
            if max(away_s, dead_s) > 0.7:
                assert bench.state is State.DISARMED
            elif away_s + dead_s + REOPENED_S < 0.7 and bench.state is not State.DISARMED:
                assert bench.state is State.ARMED
                assert min(throttles_us) > 1480
            if bench.state is State.DISARMED:
                assert set(map(round, throttles_us)) == {LOW_US}
                break
        bench.run(1.0)
        assert bench.state in (State.ARMED, State.DISARMED)
        bench.transmitter.port.close()
        bench.radio.unplug()
