"""Promises of the latency by stage: no time is lost between stages, no two clocks are mixed up."""

from types import SimpleNamespace
from typing import cast

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LinkState, RouterStatus
from rcopterx.bus.messages import Applied, CommandTiming
from rcopterx.bus.session import Session
from rcopterx.bus.subscription import Inbox
from rcopterx.ground_station.report.latency import (
    STAGES,
    TOTAL,
    WINDOW,
    LatencyWatch,
    clock_offset,
    stage_figures,
    stage_times_ms,
)

SPENT_S = {
    "tracker": 0.004,
    "gateway": 0.001,
    "agent": 0.002,
    "solver": 0.0015,
    "command": 0.0008,
    "radio": 0.0003,
}


def written(agent_ahead_s: float = 0.0, gateway_ahead_s: float = 0.0, **changes: object) -> Applied:
    """A command that spent `SPENT_S`; clocks of the agent's and the transmitter's host go ahead."""
    received = 100.0
    arrived = received + SPENT_S["gateway"]
    began = arrived + SPENT_S["agent"]
    ready = began + SPENT_S["solver"]
    at_gateway = ready + SPENT_S["command"]
    timing = CommandTiming(
        latency_s=SPENT_S["tracker"],
        gateway_host="main",
        received_s=received,
        agent_host="other",
        arrived_s=arrived + agent_ahead_s,
        began_s=began + agent_ahead_s,
        ready_s=ready + agent_ahead_s,
    )
    applied = Applied(
        state="armed", input=(0.0, 0.0, 0.0, 0.0), pulse_width_us=(1500.0,), epoch=1, frame=1, sequence=1,
        fresh=True, command_arrived_s=at_gateway + gateway_ahead_s,
        written_s=at_gateway + SPENT_S["radio"] + gateway_ahead_s, host="radio", timing=timing,
    )  # fmt: skip
    return msgspec.structs.replace(applied, **changes)


def router(**offsets_s: float | None) -> RouterStatus:
    return RouterStatus(
        links={
            host: LinkState(linked=True, redials=0, late=0, round_trip_s=1e-4, monotonic_offset_s=offset_s)
            for host, offset_s in offsets_s.items()
        }
    )


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_stages_are_right_however_far_the_clocks_of_the_hosts_are_apart(
    agent_s: float, radio_s: float
) -> None:
    statuses = {"main": router(other=agent_s), "radio": router(other=agent_s - radio_s)}
    times = stage_times_ms(
        written(agent_s, radio_s), lambda first, second: clock_offset(statuses, first, second)
    )
    assert list(times) == [*STAGES, TOTAL]
    for stage, spent_s in SPENT_S.items():
        assert times[stage] == pytest.approx(1000 * spent_s, abs=1e-6)
    assert times[TOTAL] == pytest.approx(1000 * sum(SPENT_S.values()), abs=1e-6)


def test_clocks_that_nobody_has_compared_are_never_subtracted() -> None:
    times = stage_times_ms(written(), lambda first, second: clock_offset({}, first, second))
    assert list(times) == ["tracker", "agent", "solver", "radio"]


def test_keep_alives_and_predicted_frames_have_no_stages() -> None:
    for changes in ({"command_arrived_s": None}, {"timing": None}, {"host": None}):
        assert stage_times_ms(written(**changes), lambda _first, _second: 0.0) == {}


def test_an_offset_is_known_from_either_side_and_within_a_host_it_is_zero() -> None:
    assert clock_offset({"a": router(b=2.0)}, "a", "b") == 2.0
    assert clock_offset({"a": router(b=2.0)}, "b", "a") == -2.0
    assert clock_offset({}, "a", "a") == 0.0
    assert clock_offset({"a": router(b=None)}, "a", "b") is None
    assert clock_offset({"a": router(c=2.0)}, "a", "b") is None


def test_figures_have_the_stages_that_are_known_and_the_total_last() -> None:
    figures = stage_figures(
        [{TOTAL: 1.0, "solver": float(number)} for number in range(101)] + [{"solver": 50.0}]
    )
    assert list(figures) == ["solver", TOTAL]
    assert figures["solver"] == {"p50": 50.0, "p99": pytest.approx(98.99), "max": 100.0}
    assert figures[TOTAL] == {"p50": 1.0, "p99": 1.0, "max": 1.0}


def test_live_figures_are_of_the_newest_commands() -> None:
    inbox = Inbox(channels.APPLIED, 2 * WINDOW + 1, "h1")
    subscribed = SimpleNamespace(inboxes={"h1": inbox})
    session = SimpleNamespace(clock=lambda: 0.0, subscribe_all=lambda *_, **__: subscribed)
    watch = LatencyWatch(cast(Session, session), lambda _first, _second: 0.0)
    arrived_s = written().written_s - SPENT_S["radio"]
    for number in range(2 * WINDOW):
        inbox.store(encode(written(written_s=arrived_s + 1e-3 * number)), 0.0)
    inbox.store(encode(written(timing=None)), 0.0)
    radio = watch.figures("h1")["radio"]
    assert radio["max"] == pytest.approx(2 * WINDOW - 1)
    assert radio["p50"] == pytest.approx(1.5 * WINDOW, abs=1.0)
    assert watch.figures("h2") == {}
