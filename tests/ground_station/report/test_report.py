"""Promises of the figures: recordings with known answers give them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.recorded_flight import Flight, truth

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LinkState, RouterStatus
from rcopterx.bus.messages import ArbiterState, CommandTiming, LeaderLink, TransmitterStatus
from rcopterx.bus.session import RawMessage
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.report.statistics import percentiles, rms_and_max


def passed(received_s: float, agent_host: str = "main", ahead_s: float = 0.0) -> CommandTiming:
    """A command that was 2 ms in the Tracker, 1 ms on its way to the agent, and 1 ms there."""
    arrived_s = received_s + 0.001 + ahead_s
    return CommandTiming(
        latency_s=0.002, gateway_host="main", received_s=received_s, agent_host=agent_host,
        arrived_s=arrived_s, began_s=arrived_s, ready_s=arrived_s + 0.001,
    )  # fmt: skip


def test_percentiles_of_a_known_sequence() -> None:
    assert percentiles(list(range(101))) == {"p50": 50.0, "p99": 99.0, "max": 100.0}
    assert percentiles([1.23456]) == {"p50": 1.235, "p99": 1.235, "max": 1.235}
    assert percentiles([]) is None


@given(st.lists(st.floats(0, 1e3), min_size=1))
def test_percentiles_are_ordered_and_within_the_values(values: list[float]) -> None:
    figures = percentiles(values)
    assert figures is not None
    low, high = min(values) - 1e-3, max(values) + 1e-3
    assert low <= figures["p50"] <= figures["p99"] + 1e-9 <= figures["max"] + 2e-9 <= high + 1e-3


def test_root_mean_square_and_maximum_are_millimetres() -> None:
    assert rms_and_max(np.array([0.003, 0.004])) == {"rms": 3.54, "max": 4.0}
    assert rms_and_max(np.zeros(0)) is None


def test_formation_error_is_the_distance_to_the_leader_plus_offset() -> None:
    flight = Flight()
    for frame, error_m in enumerate((0.0, 0.03, 0.04)):
        flight.pose("h1", frame, (0.1 * frame, 0.0, 1.0))
        flight.pose("h2", frame, (0.1 * frame - 0.5, 0.2 + error_m, 1.0))
        flight.plan("h2", frame, (0.0,) * 4, LeaderLink(leader="h1", offset_m=(-0.5, 0.2, 0.0)))
    figures = flight.figures("h1", "h2")
    assert figures.formation_error_m("h2") == pytest.approx([0.0, 0.03, 0.04])
    assert figures.vehicle("h2")["formation_error_mm"] == {"rms": 28.87, "max": 40.0}
    assert figures.vehicle("h1")["formation_error_mm"] is None


def test_what_follows_a_kill_until_it_is_reset_is_no_error_of_the_flight() -> None:
    flight = Flight()
    link = LeaderLink(leader="h1", offset_m=(-0.5, 0.2, 0.0))
    states: tuple[ArbiterState, ...] = ("armed", "killed", "killed", "disarmed", "armed")
    for frame, state in enumerate(states):
        flight.applied("h2", frame, 0.0, (), state=state)
        flight.pose("h1", frame, (0.0, 0.0, 1.0))
        flight.pose("h2", frame, (-0.5, 0.2, 1.0 - 0.1 * frame))
        flight.plan("h2", frame, (0.0,) * 4, link, start_s=0.0)
    figures = flight.figures("h1", "h2")
    assert figures.formation_error_m("h2") == pytest.approx([0.0, 0.3, 0.4])
    assert len(figures.tracking_errors("h2")[0]) == 3


def test_formation_error_with_several_leaders_uses_the_weighted_mean() -> None:
    flight = Flight()
    flight.pose("h1", 5, (0.0, 0.0, 1.0))
    flight.pose("h2", 5, (4.0, 0.0, 1.0))
    flight.pose("h3", 5, (1.0, 0.1, 1.0))
    links = (LeaderLink(leader="h1", weight=3.0), LeaderLink(leader="h2", weight=1.0))
    flight.plan("h3", 5, (0.0,) * 4, *links)
    assert flight.figures("h1", "h2", "h3").formation_error_m("h3") == pytest.approx([0.1])


def test_frames_in_which_somebody_was_not_seen_or_not_flown_do_not_count() -> None:
    flight = Flight()
    link = LeaderLink(leader="h1")
    flight.pose("h1", 1, (0.0, 0.0, 1.0))
    flight.pose("h2", 1, None)
    flight.pose("h1", 2, None)
    flight.pose("h2", 2, (0.0, 0.0, 1.0))
    for frame in (3, 4):
        flight.pose("h1", frame, (0.0, 0.0, 1.0))
        flight.pose("h2", frame, (0.0, 0.01, 1.0))
    for frame in (1, 2, 4):
        flight.plan("h2", frame, (0.0, 0.0, 1.0, 0.0), link)
    flight.plan("h2", 3, None, link)
    flight.plan("h2", 99, (0.0, 0.0, 1.0, 0.0), link)
    assert flight.figures("h1", "h2").formation_error_m("h2") == pytest.approx([0.01])


def test_the_truth_of_the_laboratory_counts_where_there_is_one() -> None:
    flight = Flight()
    flight.laboratory(1, 0.0, h1=truth(0.0), h2=truth(0.25))
    flight.pose("h1", 1, (9.0, 9.0, 9.0))
    flight.pose("h2", 1, (9.0, 9.0, 9.0))
    flight.plan("h2", 1, (0.0, 0.0, 1.0, 0.0), LeaderLink(leader="h1"))
    assert flight.figures("h1", "h2").formation_error_m("h2") == pytest.approx([0.25])


def test_tracking_error_is_taken_when_the_reference_was_to_be_reached() -> None:
    flight = Flight()
    for frame in range(5):
        flight.pose("h1", frame, (0.1 * frame, 0.0, 1.0))
    # The first stage lies one frame after the pose, so it is compared with the next position.
    flight.plan("h1", 2, (0.3, 0.0, 1.0, 0.0))
    flight.plan("h1", 3, (0.4, 0.05, 1.0, 0.0))
    flight.plan("h1", 4, (0.0, 0.0, 0.0, 0.0))
    assert flight.figures("h1").tracking_errors("h1")[1] == pytest.approx([0.0, 0.05])


def test_pose_to_command_counts_commands_whose_way_is_known() -> None:
    flight = Flight()
    flight.applied("h1", 0, 100.0031, (1500.0,), arrived_s=100.003, timing=passed(100.0))
    flight.applied("h1", 0, 100.0031, (1500.0,), arrived_s=100.003, fresh=False)
    flight.applied("h1", 1, 100.0241, (1500.0,), arrived_s=100.024, timing=passed(100.02))
    flight.applied("h1", 2, 100.0500, (1500.0,), arrived_s=None, timing=passed(100.04))
    flight.applied("h1", 3, 100.0701, (1500.0,), arrived_s=100.07)
    flight.applied("h1", 4, 190.0, (1500.0,), arrived_s=190.0, timing=passed(100.08))
    assert flight.figures("h1").pose_to_command_ms() == pytest.approx([3.0, 4.0])


def test_stages_between_hosts_are_told_from_when_their_clocks_have_been_compared() -> None:
    flight = Flight()
    ahead_s = 1000.0
    link = LinkState(linked=True, redials=0, late=0, round_trip_s=1e-4, monotonic_offset_s=ahead_s)
    for frame in range(2):
        timing = passed(100.0, agent_host="other", ahead_s=ahead_s)
        flight.applied("h1", frame, 100.0031, (1500.0,), arrived_s=100.003, timing=timing)
        flight.add(channels.ROUTER_STATUS, "main", RouterStatus(links={"other": link}))
    before, after = flight.figures("h1").stages["h1"]
    assert "gateway" not in before
    assert after["gateway"] == pytest.approx(1.0, abs=1e-6)
    assert after["total"] == pytest.approx(5.1, abs=1e-6)


def test_a_leader_is_judged_at_rest_and_not_while_it_flies_to_its_set_point() -> None:
    flight = Flight()
    for frame in range(400):
        flight.pose("h1", frame, (0.0 if frame < 250 else 1.01, 0.0, 1.0))
        flight.plan("h1", frame, (0.0 if frame < 200 else 1.0, 0.0, 1.0, 0.0), start_s=0.0)
    errors_m = flight.figures("h1").settled_error_m("h1")
    # Three seconds from the beginning and from the step are not counted.
    assert len(errors_m) == 50 + 50
    assert errors_m.max() == pytest.approx(0.01)


def pulses(number: int) -> tuple[float, ...]:
    return (1100.0 + number, 1500.0, 1500.0, 1500.0, 1500.0)


def test_frame_to_radio_runs_to_the_first_radio_frame_with_the_same_pulse_widths() -> None:
    flight = Flight()
    for frame in range(3):
        sent_s = 100 + 0.02 * frame
        radio = (
            (sent_s + 0.001, *pulses(frame - 1)),  # a keep-alive of the frame before
            (sent_s + 0.004, *pulses(frame)),
            (sent_s + 0.015, *pulses(frame)),  # a keep-alive of this one
        )
        flight.laboratory(frame, sent_s, h1=truth(radio=radio))
        flight.applied("h1", frame, sent_s + 0.0025, pulses(frame))
        flight.applied("h1", frame, sent_s + 0.0145, pulses(frame), fresh=False)
    assert flight.figures("h1").frame_to_radio_ms() == pytest.approx([4.0, 4.0, 4.0])


def test_radio_frames_that_are_not_found_do_not_count() -> None:
    flight = Flight()
    flight.laboratory(0, 100.0, h1=truth(radio=((100.5, *pulses(0)),)))
    flight.laboratory(1, 100.02, h1=truth(radio=((100.524, *pulses(7)),)))
    flight.applied("h1", 0, 100.002, pulses(0))
    flight.applied("h1", 1, 100.522, pulses(1))
    flight.applied("h1", 9, 100.522, pulses(7))
    assert flight.figures("h1").frame_to_radio_ms() == []


def test_a_laboratory_that_began_anew_is_not_mixed_up_with_the_one_before() -> None:
    flight = Flight()
    for epoch, start_s in ((1, 100.0), (2, 105.0)):
        for frame in range(3):
            sent_s = start_s + 0.02 * frame
            flight.pose("h1", frame, None, epoch=epoch)
            flight.laboratory(frame, sent_s, h1=truth(radio=((sent_s + 0.005, *pulses(frame)),)))
            flight.applied("h1", frame, sent_s + 0.004, pulses(frame), epoch=epoch)
    assert flight.figures("h1").frame_to_radio_ms() == pytest.approx([5.0] * 6)


def test_counters_are_told_as_their_growth_during_the_recording() -> None:
    flight = Flight()
    times = {"solve_ms_p50": 1.0, "solve_ms_p99": 2.0, "solve_ms_max": 3.0}
    flight.status("h1", 100, missed_ticks=5, fallbacks={"hover": 2, "old": 1}, **times)
    flight.status("h1", 150, missed_ticks=6, fallbacks={"hover": 4, "old": 1, "early_stop": 1})
    table = flight.figures("h1").vehicle("h1")
    assert (table["ticks"], table["missed_ticks"]) == (50, 1)
    assert table["fallbacks"] == {"hover": 2, "early_stop": 1}
    assert table["solve_ms"] == {"p50": 0.5, "p99": 2.0, "max": 3.0}


def test_an_agent_that_was_started_again_counts_from_zero() -> None:
    flight = Flight()
    for ticks, process in ((1000, 1), (1010, 1), (4, 2), (24, 2)):
        flight.status("h1", ticks, process, missed_ticks=process, fallbacks={"hover": process})
    table = flight.figures("h1").vehicle("h1")
    assert table["ticks"] == 10 + 24
    assert table["missed_ticks"] == 2
    assert table["fallbacks"] == {"hover": 2}


def test_events_of_an_estimator_count_on_when_another_one_replaces_it() -> None:
    flight = Flight()
    for ticks, raised in enumerate(({}, {"estimator_raised": 3}, {}, {"estimator_raised": 1})):
        flight.status("h1", ticks, fallbacks=raised)
    assert flight.figures("h1").vehicle("h1")["fallbacks"] == {"estimator_raised": 4}


def test_a_vehicle_that_said_nothing_has_no_ticks() -> None:
    table = Flight().figures("h1").vehicle("h1")
    assert (table["ticks"], table["missed_ticks"], table["fallbacks"], table["solve_ms"]) == (0, 0, {}, None)
    assert table["tracking_error_mm"] is None


def test_what_the_arbiter_did_is_told_once_each() -> None:
    flight = Flight()
    for state, reason in (("armed", ""), ("hold", "late"), ("hold", "late"), ("armed", ""), ("hold", "late")):
        flight.add(
            channels.TRANSMITTER_STATUS,
            "h1",
            TransmitterStatus(state=state, reason=reason, link="open", module="", ready=True),
        )
    assert flight.figures("h1").vehicle("h1")["safety"] == ["hold: late"]


def test_malformed_records_are_counted_and_left_out() -> None:
    flight = Flight()
    flight.status("h1", 1)
    recording = Recording([*flight.records, RawMessage("h1", "status", b"\xc1", 0.0)])
    assert len(recording.records()) == 2
    for _ in range(2):  # a record counts once, however often it is read
        assert len(recording.messages(channels.AGENT_STATUS, "h1")) == 1
        assert recording.rejected == {"status.malformed": 1}


def test_figures_of_an_empty_recording_are_empty() -> None:
    figures = Flight().figures("h1")
    assert figures.pose_to_command_ms() == figures.frame_to_radio_ms() == []
    assert figures.truth("h1") == []
    assert not math.isfinite(float(np.max(figures.formation_error_m("h1"), initial=-math.inf)))
