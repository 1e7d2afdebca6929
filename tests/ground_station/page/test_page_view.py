"""Promises of what a browser draws: units everywhere, equal events in one line."""

import math
from dataclasses import replace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from support.plans import plan_of
from support.statuses import flying_status

from rcopterx.bus.messages import SetPoint, TransmitterStatus
from rcopterx.ground_station.events import LoggedEvent, Timeline
from rcopterx.ground_station.page.view import events_shown, motion_of, row_of
from rcopterx.ground_station.scripting.state import VehicleState

ARMED = TransmitterStatus(state="armed", reason="by h1", link="open", module="<b>", ready=True)
AGENT = flying_status(position_m=(1.0, 2.0, 0.5), yaw_rad=3.14159265, solve_ms_p50=1.5, client="fly.m",
                      hover_thrust=0.5625, position_deviation_m=(0.0005, 0.0005, 0.001))  # fmt: skip
STATE = VehicleState("h1", AGENT, ARMED, 0.1, 0.1, 0.01, seen_age_s=0.01)


def details(state: VehicleState) -> dict[str, tuple[str, bool]]:
    shown: Any = row_of(state)["details"]
    return {name: (text, alarming) for name, text, alarming in shown}


def test_a_vehicle_in_flight_is_where_its_newest_plan_begins() -> None:
    plan = plan_of("h1", position_m=(1.5, 2.0, 0.5))
    assert motion_of(replace(STATE, plan=plan), {})["place"] == (1.5, 2.0, 0.5)
    on_floor = plan_of("h1", position_m=(1.5, 2.0, 0.5), airborne=False)
    assert motion_of(replace(STATE, plan=on_floor), {})["place"] == (1.0, 2.0, 0.5)


def test_details_have_units() -> None:
    shown = " | ".join(text for text, _ in details(STATE).values())
    for text in ("by h1", "1.00, 2.00, 0.50 m", "180°", "1.50 / 0.00 ms", "10 ms", "1.0, 1.0, 2.0 mm",
                 "hovers at 56 % of the thrust", "fly.m (external)"):  # fmt: skip
        assert text in shown, text


def test_details_show_where_commands_spend_their_time() -> None:
    figures = {"p50": 1.24, "p99": 2.5, "max": 3.0}
    shown = details(replace(STATE, latency_ms={"solver": figures, "total": figures}))
    assert shown["latency solver, p50 / p99 / max"] == ("1.2 / 2.5 / 3.0 ms", False)
    assert "latency total, p50 / p99 / max" in shown
    assert "latency radio, p50 / p99 / max" not in shown


def test_remarks_are_alarms_in_the_details() -> None:
    warned = replace(STATE, agent=flying_status(remarks=("the battery is nearly empty",)))
    assert details(warned)["remarks"] == ("the battery is nearly empty", True)


@given(st.floats(-1e3, 1e3))
def test_headings_of_set_points_are_within_half_a_turn(yaw_rad: float) -> None:
    status = flying_status(set_point=SetPoint(position_m=(0.0, 0.0, 1.0), yaw_rad=yaw_rad))
    shown: Any = row_of(replace(STATE, agent=status))["set_point"]
    assert -180 < shown[3] <= 180
    assert math.cos(math.radians(shown[3]) - yaw_rad) > math.cos(math.radians(0.51))


def shown(*events: LoggedEvent) -> list[tuple[float, str, str, bool]]:
    timeline = Timeline()
    for event in events:
        timeline.add(event)
    return events_shown(timeline.lines)


def test_events_are_newest_first_and_equal_ones_share_a_line() -> None:
    events = [
        LoggedEvent(1.0, "h1", "landed"),
        LoggedEvent(60.0, "h2", "poses lost"),
        LoggedEvent(61.0, "h2", "poses lost"),
        LoggedEvent(62.0, "h2", "poses lost"),
        LoggedEvent(63.0, "h1", "landed", True),
        LoggedEvent(63.1, "h2", "landed", True),
    ]
    assert shown(*events) == [
        (63.1, "h1, h2", "landed", True),
        (62.0, "h2", "poses lost, 3 times", False),
        (1.0, "h1", "landed", False),
    ]
    assert shown() == []


def test_counted_events_with_other_counts_share_a_line_in_words() -> None:
    events = [
        LoggedEvent(1.0, "h1", "pose_extrapolated", count=47),
        LoggedEvent(2.0, "h2", "pose_extrapolated", count=1),
        LoggedEvent(3.0, "h1", "pose_extrapolated", count=2),
    ]
    assert shown(*events) == [(3.0, "h1, h2", "pose extrapolated, 49 times", False)]
