"""Promises of fault flights are judged on the laboratory's truth."""

from dataclasses import replace
from typing import Any

import pytest
from support.statuses import flying_status

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.messages import Applied
from rcopterx.bus.session import RawMessage
from rcopterx.ground_station.report.recorder import Recording
from rcopterx_studies.faults.observation import broken_in, seen_of
from rcopterx_studies.faults.promise import (
    LIMITS,
    Promise,
    PromisedLimits,
    SeenFlight,
    judged,
    judged_take_off,
    outcome,
)

FLEW = SeenFlight(100, 20.0, None, None, 40.0, ("armed",))
LANDED = SeenFlight(100, 1000.0, 100.0, 0.4, 2000.0, ("armed", "hold", "land", "cut"))
ON = Promise.FLIES_ON


def failed(promise: Promise, down: tuple[str, ...], seen: dict[str, SeenFlight]) -> list[str]:
    return [check["name"] for check in judged(promise, down, LIMITS[promise], seen) if not check["passed"]]


def test_flight_in_which_all_keep_their_places_keeps_the_promise_to_fly_on() -> None:
    assert failed(ON, (), {"h1": FLEW, "h2": FLEW}) == []


@pytest.mark.parametrize(
    ("seen", "broken"),
    [
        (LANDED, "no other vehicle comes down"),
        (replace(FLEW, deviation_mm=151.0), "at most 150 mm from its place"),
        (replace(FLEW, silence_ms=601.0), "at most 600 ms without a fresh command"),
        (replace(FLEW, silence_ms=None), "at most 600 ms without a fresh command"),
        (replace(FLEW, states=3), "the true states of all vehicles are known"),
    ],
)
def test_each_of_these_breaks_the_promise_to_fly_on(seen: SeenFlight, broken: str) -> None:
    assert broken in failed(ON, (), {"h1": FLEW, "h2": seen})


@pytest.mark.parametrize(
    ("seen", "broken"),
    [
        (FLEW, "h2 comes down"),
        (replace(LANDED, drift_mm=301.0), "at most 300 mm from its place at touchdown"),
        (replace(LANDED, touchdown_m_s=0.61), "at most 0.6 m/s at touchdown"),
    ],
)
def test_each_of_these_breaks_the_promise_to_land_closed_loop(seen: SeenFlight, broken: str) -> None:
    assert failed(Promise.LANDS, ("h2",), {"h1": FLEW, "h2": LANDED}) == []
    assert broken in failed(Promise.LANDS, ("h2",), {"h1": FLEW, "h2": seen})


STOOD = SeenFlight(100, 2.0, None, None, 40.0, ("disarmed",), highest_m=0.01, ended="disarmed")
LIMITS_OF_STANDING = LIMITS[Promise.STAYS_DOWN]


@pytest.mark.parametrize(
    ("seen", "line", "broken"),
    [
        (STOOD, "h1: its pose is frozen", []),
        (replace(STOOD, touchdown_m_s=0.9, ended="cut"), "frozen", []),
        (STOOD, "charge the battery", ["the cause is named"]),
        (replace(STOOD, highest_m=0.16), "frozen", ["at most 0.15 m high"]),
        (replace(STOOD, touchdown_m_s=1.1), "frozen", ["at most 1 m/s at touchdown"]),
        (replace(STOOD, ended="armed"), "frozen", ["the motors are off"]),
        (replace(STOOD, states=3), "frozen", ["the true states of all vehicles are known"]),
    ],
)
def test_take_off_with_a_fault_ends_on_the_floor_and_names_the_cause(
    seen: SeenFlight, line: str, broken: list[str]
) -> None:
    checks = judged_take_off({"h1": seen, "h2": STOOD}, LIMITS_OF_STANDING, "frozen|repeat", ["fine", line])
    assert [check["name"] for check in checks if not check["passed"]] == broken
    assert outcome(Promise.STAYS_DOWN, {"h1": seen}) == f"at most {seen.highest_m:.2f} m high"


@pytest.mark.parametrize(
    ("remarks", "broken"),
    [
        (("bandwidth lowered: pitch stick", "it lands: 0.20 m off its place"), []),
        (("bandwidth lowered: pitch stick",), ["why it lands is reported"]),
        ((), ["why it lands is reported"]),
    ],
)
def test_a_vehicle_that_lands_and_reports_has_a_remark_why_it_lands(
    remarks: tuple[str, ...], broken: list[str]
) -> None:
    landed = {"h1": replace(FLEW, remarks=("it lands: ",)), "h2": replace(LANDED, remarks=remarks)}
    assert failed(Promise.LANDS_AND_REPORTS, ("h2",), landed) == broken


def test_no_other_vehicle_may_come_down_where_one_lands() -> None:
    assert "no other vehicle comes down" in failed(Promise.LANDS, ("h2",), {"h1": LANDED, "h2": LANDED})


def test_a_row_without_limits_still_wants_to_know_who_comes_down() -> None:
    checks = judged(ON, (), PromisedLimits(None, None, None, None), {"h1": LANDED})
    assert [check["name"] for check in checks if not check["passed"]] == ["no other vehicle comes down"]


def test_outcome_is_described_in_words() -> None:
    assert outcome(ON, {"h1": FLEW}) == "flies on"
    assert outcome(Promise.LANDS, {"h1": FLEW, "h2": LANDED}) == "h2 down after LAND, the others fly on"
    dropped = replace(LANDED, states_of_arbiter=("armed", "descend", "cut"))
    assert outcome(Promise.LANDS_OPEN_LOOP, {"h2": dropped}) == "h2 down"
    assert outcome(Promise.REFUSED, {"h1": LANDED}) == "refused"
    assert outcome(Promise.LANDS, {"h1": FLEW}) == "all fly on"


def truth(frame: int, x_m: float, **more: Any) -> RawMessage:
    vehicle = LaboratoryVehicle(
        position_m=(x_m, 0.0, 1.0), yaw_rad=0.0, velocity_m_s=(0.0, 0.0, 0.0),
        **{"on_floor": False, "outside": False, **more},
    )  # fmt: skip
    state = LaboratoryState(frame=frame, sent_s=0.02 * frame, vehicles={"h1": vehicle})
    return RawMessage(channels.SIMULATOR_UNIT, "laboratory", encode(state), 0.02 * frame)


def written(at_s: float, state: str = "armed", fresh: bool = True) -> RawMessage:
    applied = Applied(
        state=state, input=(0.0, 0.0, 0.5, 0.0), pulse_width_us=(1500.0,), epoch=1, frame=1, sequence=1,
        fresh=fresh, written_s=at_s,
    )  # fmt: skip
    return RawMessage("h1", "applied", encode(applied), at_s)


def test_recording_shows_the_largest_distance_and_the_longest_time_without_a_command() -> None:
    records = [truth(1, 0.0), truth(2, 0.03), truth(3, 0.01)]
    records += [written(0.0), written(0.1, "hold", fresh=False), written(0.3)]
    seen = seen_of(Recording(records), {"h1": (0.0, 0.0, 1.0)})["h1"]
    assert seen == SeenFlight(3, 30.0, None, None, 300.0, ("armed", "hold", "armed"), highest_m=1.0)
    assert not seen.down


def test_the_hardest_touchdown_counts_and_the_place_of_the_last_one_although_the_vehicle_hops() -> None:
    records = [
        truth(1, 0.0, touchdowns=1, touchdown_speed_m_s=3.0),
        truth(2, 0.1, touchdowns=2, touchdown_speed_m_s=0.7, on_floor=True),
        truth(3, 0.2, touchdowns=3, touchdown_speed_m_s=0.1, on_floor=True),
        truth(4, 0.3, touchdowns=3, touchdown_speed_m_s=0.1),
    ]
    seen = seen_of(Recording(records), {"h1": (0.0, 0.0, 1.0)})["h1"]
    assert (seen.touchdown_m_s, seen.drift_mm, seen.silence_ms) == (0.7, 200.0, None)


def test_remarks_of_the_agent_are_seen_once_and_in_their_order() -> None:
    records = [
        RawMessage("h1", "status", encode(flying_status(remarks=remarks)), 0.2 * number)
        for number, remarks in enumerate(
            [(), ("lowered",), ("lowered", "it lands: late"), ("it lands: late",)]
        )
    ]
    seen = seen_of(Recording(records), {"h1": (0.0, 0.0, 1.0)})["h1"]
    assert seen.remarks == ("lowered", "it lands: late")


def test_nothing_is_known_of_a_vehicle_without_messages() -> None:
    assert seen_of(Recording([]), {"h1": (0.0, 0.0, 1.0)})["h1"].states == 0


def test_flight_that_breaks_a_promise_of_every_flight_fails() -> None:
    broken = broken_in(Recording([written(0.0), written(0.02, "disarmed", fresh=False)]))
    assert len(broken) == 1
    assert "while disarmed" in broken[0]
    checks = judged(ON, (), LIMITS[ON], {"h1": FLEW}, broken)
    assert [check["figure"] for check in checks if not check["passed"]] == [broken]
