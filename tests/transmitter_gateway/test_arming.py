"""When a vehicle may be armed, and what is missing if not."""

import pytest
from arbiter_bench import HOVER, IDLE, Bench, flying

from rcopterx.bus.message import LONGEST_PERIOD_S, SHORTEST_PERIOD_S
from rcopterx.transmitter_gateway.inputs import NEUTRAL, Action, Cause, Input, LinkState, State


def test_arbiter_starts_disarmed_with_neutral_output() -> None:
    bench = Bench()
    output = bench.run(1.0)
    assert (output.state, output.u) == (State.DISARMED, NEUTRAL)
    assert output.cause is None


def test_arming_lets_commands_count() -> None:
    bench = Bench()
    answer = bench.arm()
    assert answer.accepted
    assert answer.reason == "ARMED: armed: by operator"
    assert bench.arbiter.commanded
    output = bench.run(0.2, (0.1, -0.1, 0.04, 0.05))
    assert output.u == (0.1, -0.1, 0.04, 0.05)
    assert output.cause == Cause(1, bench.epoch, bench.sequence, bench.frame)


@pytest.mark.parametrize("period_s", [SHORTEST_PERIOD_S, LONGEST_PERIOD_S])
def test_vehicle_of_the_shortest_and_of_the_longest_control_period_is_armed_and_flies(
    period_s: float,
) -> None:
    bench = Bench()

    def run(seconds: float, u: Input) -> None:
        for _ in range(round(seconds / period_s)):
            bench.wait(period_s)
            bench.frame += 1
            bench.pose()
            assert bench.command(u, period_s=period_s).accepted

    run(0.6, IDLE)
    assert bench.request(Action.ARM).accepted
    run(0.6, HOVER)
    assert bench.arbiter.counters["entered HOLD"] == 0
    assert bench.state is State.ARMED


def test_arming_needs_low_thrust_for_half_a_second() -> None:
    bench = Bench()
    bench.run(0.5, HOVER)
    bench.run(0.5, (0, 0, 0.05, 0))
    answer = bench.request(Action.ARM)
    assert answer.reason == "missing: commanded thrust low long enough"
    bench.run(0.04, (0, 0, 0.05, 0))
    assert bench.request(Action.ARM).accepted


def test_thrust_above_the_low_limit_restarts_the_half_second() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    bench.run(0.02, (0, 0, 0.051, 0))
    bench.run(0.4, IDLE)
    assert not bench.request(Action.ARM).accepted


def test_a_gap_in_the_stream_restarts_the_half_second() -> None:
    bench = Bench()
    bench.run(0.5, IDLE)
    bench.run(0.08, None)
    bench.run(0.4, IDLE)
    assert not bench.request(Action.ARM).accepted
    bench.run(0.14, IDLE)
    assert bench.request(Action.ARM).accepted


def test_arming_needs_fresh_commands() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    bench.run(0.08, None)
    assert bench.request(Action.ARM).reason == "missing: commands fresh"


def test_arming_a_vehicle_that_nobody_commands_says_all_that_is_missing() -> None:
    bench = Bench()
    bench.run(0.6, None)
    answer = bench.request(Action.ARM)
    assert answer.reason == "missing: commanded thrust low long enough; missing: commands fresh"
    assert bench.state is State.DISARMED


@pytest.mark.parametrize(
    ("link", "words"),
    [
        (LinkState.UP, "missing: transmitter ready"),
        (LinkState.LOST, "missing: transmitter ready; serial link lost"),
    ],
)
def test_arming_needs_a_ready_transmitter(link: LinkState, words: str) -> None:
    bench = Bench()
    bench.arbiter.link(link)
    assert bench.arm().reason == words


def test_arming_needs_a_tracked_vehicle() -> None:
    bench = Bench()
    bench.position = None
    assert bench.arm().reason == "surveillance: descend: own pose lost for 0.3 s"


def test_arming_beside_another_vehicle_is_refused() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    bench.pose("h2", (0.2, 0.0, 0.6))
    assert bench.request(Action.ARM).reason == "surveillance: hold: h2 closer than 0.3 m"


def test_only_an_operator_may_arm() -> None:
    bench = Bench()
    bench.run(0.6, IDLE)
    assert bench.request(Action.ARM, by="stranger").reason == "only an operator may arm"
    assert bench.request(Action.ARM).accepted
    assert bench.arbiter.counters["refused: arm"] == 1


def test_arming_again_changes_nothing() -> None:
    bench = flying()
    entered = bench.arbiter.counters["entered ARMED"]
    assert bench.request(Action.ARM).accepted
    assert bench.arbiter.counters["entered ARMED"] == entered


def test_arming_while_shutting_down_is_refused() -> None:
    bench = Bench()
    bench.request(Action.SHUTDOWN)
    assert bench.arm().reason == "shutting down"
