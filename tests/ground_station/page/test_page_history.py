"""Promises of the samples of the page: two minutes at ten a second, without gaps for any browser."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
from support.plans import plan_of
from support.statuses import flying_status

from rcopterx.bus.messages import Battery, TransmitterStatus
from rcopterx.ground_station.page.feed import Feed, Seen
from rcopterx.ground_station.page.history import KEPT_S, SAMPLE_S, SIGNALS, sample_of
from rcopterx.ground_station.scripting.state import VehicleState

SEEN = VehicleState("h1", flying_status(position_m=(1.0, 2.0, 3.0), yaw_rad=-4.0), None, 0.1, None, 0.01)


def named(state: VehicleState, sticks: tuple[float, ...] | None = None) -> dict[str, float | None]:
    return dict(zip((name for name, *_ in SIGNALS), sample_of(state, sticks), strict=True))


def received(feed: Feed, seen: Seen) -> dict[str, Any]:
    message = feed.after(seen)
    found: dict[str, Any] = {} if message is None else json.loads(message)
    return found


def test_a_browser_gets_the_last_two_minutes_first_and_then_what_is_new() -> None:
    feed, seen = Feed(), Seen()
    for number in range(2000):
        feed.add_sample(SAMPLE_S * number, [[float(number)]])
    rows = received(feed, seen)["samples"]
    assert len(rows) == round(KEPT_S / SAMPLE_S)
    assert rows[-1] == [199.9, [1999.0]]
    assert feed.after(seen) is None
    feed.add_sample(200.0, [[None]])
    feed.add_sample(200.1, [[7.0]])
    assert received(feed, seen)["samples"] == [[200.0, [None]], [200.1, [7.0]]]


def test_samples_of_another_fleet_are_not_sent() -> None:
    feed = Feed()
    feed.put("fleet", {"vehicles": ["h1"]})
    feed.add_sample(1.0, [[1.0]])
    feed.put("fleet", {"vehicles": ["h1", "h2"]})
    feed.add_sample(2.0, [[1.0], [2.0]])
    assert received(feed, Seen())["samples"] == [[2.0, [1.0], [2.0]]]


def test_a_slow_browser_skips_states_and_gets_the_newest() -> None:
    feed, seen = Feed(), Seen()
    for number in range(5):
        feed.put("motion", {"h1": number})
    feed.put("texts", "first")
    assert received(feed, seen) == {"motion": {"h1": 4}, "texts": "first"}
    feed.put("texts", "second")
    assert received(feed, seen) == {"texts": "second"}


def test_headings_are_within_half_a_turn_and_errors_are_distances_from_the_reference() -> None:
    plan = plan_of("h1", position_m=(1.0, 2.0, 3.0), reference_m=(1.0, 2.1, 3.0))
    values = named(replace(SEEN, plan=plan), (0.1, 0.2, 0.3, 0.4))
    assert values["heading_deg"] == round(math.degrees(math.tau - 4.0))
    assert values["error_mm"] == 100.0
    assert values["reference_y_m"] == 2.1
    assert values["thrust"] == 0.3


def test_what_is_unknown_is_absent() -> None:
    values = named(replace(SEEN, agent=flying_status(position_m=None)))
    assert {values[name] for name in ("x_m", "heading_deg", "pitch", "error_mm", "voltage_v")} == {None}
    status = TransmitterStatus(
        state="armed", reason="", link="open", module="", ready=True, battery=Battery(voltage_v=3.7)
    )
    assert named(replace(SEEN, transmitter=status))["voltage_v"] == 3.7


def test_percentiles_of_latencies_can_be_sent() -> None:
    figures = {"p50": np.percentile([3.0, 4.0], 50), "p99": np.float64(4.0), "max": np.float64(4.0)}
    feed = Feed()
    feed.add_sample(0.0, [sample_of(replace(SEEN, latency_ms={"total": figures}), None)])
    assert received(feed, Seen())["samples"][0][1][-1] == 3.5
