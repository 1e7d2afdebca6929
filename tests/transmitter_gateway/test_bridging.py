"""Planned inputs are played while the next command is late."""

import pytest
from arbiter_bench import EDGE_S, HOVER, PLAN, flying, silent

from rcopterx.transmitter_gateway.inputs import Cause, State


def test_planned_inputs_are_played_one_per_period_then_hold() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    sent_s = bench.now_s
    seen: dict[int, float] = {}
    while bench.state is State.ARMED:
        silent(bench, 0.001)
        step = bench.outputs[-1].bridging_step
        if bench.state is State.ARMED:
            seen.setdefault(step, bench.now_s - sent_s)
    expected = {0: 0.001, 1: 0.03, 2: 0.04, 3: 0.06, 4: 0.08, 5: 0.1, 6: 0.12, 7: 0.14, 8: 0.16}
    assert seen == pytest.approx(expected, abs=0.0011)
    assert bench.now_s - sent_s == pytest.approx(0.18, abs=0.0011)
    assert bench.state is State.HOLD
    assert bench.arbiter.counters["planned inputs played"] == 8
    silent(bench, 0.06)
    assert bench.state is State.DESCEND


def test_planned_inputs_are_applied() -> None:
    bench = flying()
    bench.run(0.3, (0, 0, 0.5, 0), next_u=PLAN)
    silent(bench, 0.059)
    assert bench.outputs[-1].bridging_step == 2
    assert bench.outputs[-1].u == pytest.approx((0, 0, 0.52, 0))
    assert bench.outputs[-1].cause == Cause(1, 7, bench.sequence, bench.outputs[-1].cause.frame)  # type: ignore[union-attr]  # fails if None


@pytest.mark.parametrize(
    ("period_s", "then"),
    [(0.005, State.HOLD), (0.01, State.HOLD), (0.018, State.HOLD), (0.02, State.DESCEND)],
)
def test_long_plan_bridges_the_same_time_at_any_rate(period_s: float, then: State) -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN * 5, period_s=period_s)
    silent(bench, 0.18 + period_s - EDGE_S)
    assert (bench.state, bench.outputs[-1].bridging_step) == (State.ARMED, round(0.18 / period_s))
    silent(bench, 2 * EDGE_S)
    assert bench.state is then


@pytest.mark.parametrize(("count", "hold_s"), [(1, 0.06), (2, 0.06), (3, 0.08), (5, 0.12)])
def test_a_short_plan_holds_when_it_is_used_up(count: int, hold_s: float) -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN[:count])
    silent(bench, hold_s - EDGE_S)
    assert bench.state is State.ARMED
    silent(bench, 2 * EDGE_S)
    assert bench.state is State.HOLD


@pytest.mark.parametrize(
    ("period_s", "until_s", "then"),
    [(0.01, 0.09, State.HOLD), (0.03, 0.2, State.DESCEND), (0.05, 0.2, State.DESCEND)],
)
def test_bridging_lasts_as_long_as_the_plan_at_any_rate(period_s: float, until_s: float, then: State) -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN, period_s=period_s)
    silent(bench, until_s - EDGE_S)
    assert bench.state is State.ARMED
    silent(bench, 2 * EDGE_S)
    assert bench.state is then


def test_a_new_command_ends_bridging() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    silent(bench, 0.07)
    assert bench.outputs[-1].bridging_step == 3
    bench.command(HOVER, next_u=PLAN)
    assert bench.outputs[-1].bridging_step == 0
    silent(bench, 0.05)
    assert bench.arbiter.counters["planned inputs played"] == 5


def test_bridging_needs_a_plausible_pose() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    bench.wait(0.1)
    assert bench.state is State.HOLD
    assert bench.reason == "raw poses: own pose lost for 0.1 s"


def test_bridging_does_not_return_from_hold() -> None:
    bench = flying()
    bench.run(0.3, HOVER, next_u=PLAN)
    bench.wait(0.1)
    bench.frame += 1
    bench.pose()
    assert bench.wait(0.001).state is State.HOLD
    bench.command(HOVER)
    assert bench.state is State.ARMED
