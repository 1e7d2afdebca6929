"""Promises of the fleet clock and of the inputs on their way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.flight.timeline import HISTORY_LENGTH, FleetClock, InputHistory

PERIOD_S = 0.02


def started(frame: int = 10, epoch: int = 1) -> FleetClock:
    clock = FleetClock()
    assert clock.frames_until(epoch, frame, PERIOD_S) == 0
    return clock


def take(clock: FleetClock, frame: int, epoch: int = 1) -> int:
    pending = clock.frames_until(epoch, frame, PERIOD_S)
    for _ in range(max(0, pending)):
        clock.pass_period()
    return pending


def test_the_first_frame_starts_the_clock() -> None:
    clock = started(4711)
    assert (clock.time_s, clock.current_frame, clock.period_s, clock.started) == (0.0, 4711, PERIOD_S, True)


def test_successive_frames_are_one_period_apart() -> None:
    clock = started()
    assert [take(clock, frame) for frame in (11, 12, 13)] == [1, 1, 1]
    assert clock.time_s == pytest.approx(3 * PERIOD_S)


def test_a_gap_counts_every_frame_that_did_not_come() -> None:
    clock = started()
    assert take(clock, 15) == 5
    assert clock.current_frame == 15
    assert clock.time_s == pytest.approx(5 * PERIOD_S)


@pytest.mark.parametrize("frame", [10, 9, 0])
def test_old_and_repeated_frames_are_refused_and_change_nothing(frame: int) -> None:
    clock = started()
    assert take(clock, frame) < 0
    assert (clock.frame, clock.time_s, clock.current_frame) == (10, 0.0, 10)


def test_an_epoch_that_is_over_is_refused_and_changes_nothing() -> None:
    clock = started(frame=10, epoch=5)
    assert take(clock, 11, epoch=4) < 0
    assert (clock.epoch, clock.frame, clock.time_s) == (5, 10, 0.0)
    assert take(clock, 3, epoch=6) == 1
    assert (clock.epoch, clock.frame) == (6, 3)


def test_coasted_frames_are_not_counted_a_second_time() -> None:
    clock = started()
    clock.coast()
    clock.coast()
    assert clock.current_frame == 12
    assert take(clock, 13) == 1
    assert clock.time_s == pytest.approx(3 * PERIOD_S)
    assert clock.current_frame == clock.frame


def test_a_stalled_tracker_that_goes_on_with_the_next_frame_costs_no_time_twice() -> None:
    clock = started()
    for _ in range(5):
        clock.coast()
    assert take(clock, 11) == 0
    assert clock.current_frame == 11
    assert take(clock, 12) == 1


def test_a_new_epoch_is_one_period_whatever_its_frame_numbers() -> None:
    clock = started(frame=1000)
    assert take(clock, 3, epoch=2) == 1
    assert (clock.epoch, clock.frame) == (2, 3)
    assert take(clock, 4, epoch=2) == 1
    assert clock.time_s == pytest.approx(2 * PERIOD_S)


def test_a_new_epoch_that_was_coasted_to_costs_nothing_more() -> None:
    clock = started()
    clock.coast()
    assert take(clock, 3, epoch=2) == 0
    assert clock.time_s == pytest.approx(PERIOD_S)


@given(st.lists(st.one_of(st.none(), st.integers(1, 5)), max_size=40))
def test_time_never_goes_back_and_covers_every_frame_seen(steps: list[int | None]) -> None:
    clock, frame, before_s = started(0), 0, 0.0
    for step in steps:
        if step is None:
            clock.coast()
        else:
            frame += step
            take(clock, frame)
            assert clock.current_frame == frame
        assert clock.time_s >= before_s
        before_s = clock.time_s
    assert clock.time_s >= frame * PERIOD_S - 1e-9


def value(number: float) -> np.ndarray:
    return np.full(4, number)


def played(history: InputHistory, start_s: float, end_s: float) -> list[tuple[float, float]]:
    pieces = history.between(start_s, end_s)
    return [(float(input_[0]), round(duration_s, 9)) for input_, duration_s in pieces]


def test_before_anything_was_sent_the_initial_input_acts() -> None:
    history = InputHistory(value(0.1))
    assert played(history, 0.0, 0.02) == [(0.1, 0.02)]
    assert history.newest[0] == 0.1


def test_inputs_act_from_their_time_on() -> None:
    history = InputHistory(value(0.0))
    history.append(0.02, 1, value(1.0))
    history.append(0.05, 2, value(2.0))
    assert played(history, 0.0, 0.02) == [(0.0, 0.02)]
    assert played(history, 0.0, 0.06) == [(0.0, 0.02), (1.0, 0.03), (2.0, 0.01)]
    assert played(history, 0.03, 0.04) == [(1.0, 0.01)]
    assert played(history, 0.05, 0.09) == [(2.0, 0.04)]
    assert played(history, 0.05, 0.05) == []
    assert history.newest[0] == 2.0


def test_what_the_gateway_applied_replaces_what_was_sent() -> None:
    history = InputHistory(value(0.0))
    history.append(0.0, 7, value(1.0))
    history.append(0.02, 8, value(2.0))
    history.correct(7, value(1.5))
    assert played(history, 0.0, 0.04) == [(1.5, 0.02), (2.0, 0.02)]


@pytest.mark.parametrize("sequence", [-5, 6, 99])
def test_sequences_that_were_never_sent_change_nothing(sequence: int) -> None:
    history = InputHistory(value(0.0))
    history.append(0.0, 7, value(1.0))
    history.append(0.02, 8, value(2.0))
    history.correct(sequence, value(9.0))
    assert played(history, 0.0, 0.04) == [(1.0, 0.02), (2.0, 0.02)]


@given(
    st.lists(st.floats(0.001, 0.05), max_size=HISTORY_LENGTH - 1),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_pieces_fill_the_interval_in_order(gaps: list[float], one_s: float, other_s: float) -> None:
    start_s, end_s = sorted((one_s, other_s))
    history, at_s = InputHistory(value(0.0)), 0.0
    effects = [(-1.0, 0.0)]
    for number, gap_s in enumerate(gaps, start=1):
        at_s += gap_s
        history.append(at_s, number, value(float(number)))
        effects.append((at_s, float(number)))
    pieces = history.between(start_s, end_s)
    assert sum(duration_s for _, duration_s in pieces) == pytest.approx(end_s - start_s, abs=1e-5)
    numbers = [float(input_[0]) for input_, _ in pieces]
    assert numbers == sorted(numbers)
    cursor_s = start_s
    for input_, duration_s in pieces:
        middle_s = cursor_s + duration_s / 2
        acting = [number for effect_s, number in effects if effect_s <= middle_s + 1e-5][-1]
        assert abs(float(input_[0]) - acting) <= 1
        cursor_s += duration_s
