"""Promises of the pacing: control periods follow frame numbers, and what was missed is counted."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.load import Pacing


def due(pacing: Pacing, frames: range | list[int], period_s: float, flying: bool = True) -> list[int]:
    pacing.on_pose(0, 0.0, period_s)
    return [frame for frame in frames if pacing.control_due(frame, flying)]


@pytest.mark.parametrize(("rate_hz", "per_tick"), [(50, 1), (100, 2), (200, 4), (25, 1)])
def test_control_keeps_its_rate_whatever_the_rate_of_the_motion_capture(rate_hz: int, per_tick: int) -> None:
    pacing = Pacing(0.02)
    assert due(pacing, range(1000, 1040), 1 / rate_hz) == list(range(1000, 1040, per_tick))
    assert pacing.frames_per_tick == per_tick
    assert pacing.ticks == 40 // per_tick
    assert pacing.missed_ticks == 0


def test_leaders_and_followers_take_the_same_frames_whenever_they_started() -> None:
    one, other = Pacing(0.02), Pacing(0.02)
    due(one, [1001], 0.005)
    due(other, [1002], 0.005)
    assert due(one, range(1003, 1030), 0.005) == due(other, range(1003, 1030), 0.005)


def test_after_a_gap_control_is_due_at_once_and_the_missed_periods_are_counted() -> None:
    pacing = Pacing(0.02)
    due(pacing, [0], 0.02)
    assert due(pacing, [4], 0.02) == [4]
    assert pacing.missed_ticks == 3
    fast = Pacing(0.02)
    due(fast, [0], 0.005)
    assert due(fast, [13], 0.005) == [13]
    assert fast.missed_ticks == 2
    assert due(fast, [14, 15, 16], 0.005) == [16]
    assert fast.missed_ticks == 2


def test_nothing_is_missed_on_the_floor() -> None:
    pacing = Pacing(0.02)
    due(pacing, [0, 50], 0.02, flying=False)
    assert pacing.missed_ticks == 0


def test_frame_numbers_that_begin_anew_are_due_at_once_and_nothing_is_missed() -> None:
    pacing = Pacing(0.02)
    due(pacing, [5000], 0.02)
    assert due(pacing, [3, 4], 0.02) == [3, 4]
    assert pacing.missed_ticks == 0


def begun(pacing: Pacing, *frames: int, epoch: int = 1, flying: bool = True) -> int:
    """Periods missed so far, after further ones have begun."""
    for frame in frames:
        pacing.on_begin(epoch, frame, flying)
    return pacing.missed_ticks


def test_a_command_overtaken_by_the_next_period_is_missed() -> None:
    pacing = Pacing(0.02)
    assert begun(pacing, 4) == 0
    assert begun(pacing, 8, 12) == 2
    pacing.on_command()
    assert begun(pacing, 16) == 2
    assert pacing.overtaken_ticks == 2


def test_a_late_pose_that_begins_the_period_of_its_frame_again_overtakes_nothing() -> None:
    pacing = Pacing(0.02)
    begun(pacing, 4)
    pacing.on_command()
    # 8 is bridged by prediction, and its pose arrives before the plans that it waits for
    assert begun(pacing, 8, 8) == 0
    pacing.on_command()
    # 12 and 16 are bridged and commanded; then the poses of 12 to 20 arrive at once
    for frame in (12, 16):
        begun(pacing, frame)
        pacing.on_command()
    assert begun(pacing, 12, 16, 20) == 0
    assert begun(pacing, 24) == 1


def test_a_period_in_a_new_epoch_overtakes_one_without_a_command() -> None:
    pacing = Pacing(0.02)
    assert begun(pacing, 5000) == 0
    assert begun(pacing, 4, epoch=2) == 1
    pacing.on_command()
    assert begun(pacing, 8, epoch=2) == 1


def test_no_period_is_overtaken_on_the_floor() -> None:
    assert begun(Pacing(0.02), 4, 8, 12, flying=False) == 0


@given(st.lists(st.integers(1, 9), min_size=1, max_size=60), st.sampled_from([0.02, 0.01, 0.005]))
def test_periods_and_missed_periods_add_up_to_the_time_flown(steps: list[int], period_s: float) -> None:
    pacing, frame = Pacing(0.02), 0
    due(pacing, [0], period_s)
    last = 0
    for step in steps:
        frame += step
        last = (due(pacing, [frame], period_s) or [last])[-1]
    per_tick = pacing.frames_per_tick
    assert pacing.ticks + pacing.missed_ticks <= 1 + len(steps) + last / per_tick
    assert pacing.missed_ticks <= last / per_tick
    assert frame - last < per_tick


def test_a_pose_is_overdue_after_one_and_a_half_periods_and_then_every_period() -> None:
    pacing = Pacing(0.02)
    assert pacing.overdue_at_s == math.inf
    pacing.on_pose(0, 100.0, 0.02)
    overdue = []
    for _ in range(3):
        overdue.append(pacing.overdue_at_s)
        pacing.on_coast()
    assert overdue == pytest.approx([100.03, 100.05, 100.07])
    pacing.on_pose(1, 100.1, 0.01)
    assert pacing.overdue_at_s == pytest.approx(100.115)


def delays_s(arrivals_s: list[float], frames: list[int] | None = None, period_s: float = 0.02) -> list[float]:
    """How late each pose of a stream is."""
    pacing, delays = Pacing(0.02), []
    for frame, arrived_s in zip(frames or range(len(arrivals_s)), arrivals_s, strict=True):
        pacing.on_pose(frame, arrived_s, period_s)
        delays.append(pacing.pose_delay_s)
    return delays


def test_poses_that_wait_for_a_processor_are_late_although_they_have_just_arrived() -> None:
    steady = [100.0 + 0.02 * frame for frame in range(50)]
    assert delays_s(steady) == pytest.approx([0.0] * 50, abs=1e-3)
    starved = [arrived_s + (0.03 if 10 <= frame < 30 else 0.0) for frame, arrived_s in enumerate(steady)]
    late = [frame for frame, delay_s in enumerate(delays_s(starved)) if delay_s > 0.018]
    assert late == list(range(10, 30))


def frames_behind(arrivals_s: list[float], frames: list[int]) -> list[int]:
    """Frames whose poses have waited during a pause."""
    pacing, behind = Pacing(0.02), []
    for frame, arrived_s in zip(frames, arrivals_s, strict=True):
        pacing.on_pose(frame, arrived_s, 0.02)
        if pacing.behind:
            behind.append(frame)
    return behind


def test_poses_that_waited_while_the_process_was_stopped_are_behind() -> None:
    before = [100.0 + 0.02 * frame for frame in range(10)]
    # Stopped for 2 s: the poses of the first second arrive at once, the connection lost those of the other.
    burst = [102.2 + 0.0005 * number for number in range(40)]
    after = [102.22 + 0.02 * number for number in range(5)]
    frames = [*range(50), *range(111, 116)]
    assert frames_behind(before + burst + after, frames) == [*range(10, 50), 111]


def test_poses_after_a_pause_of_the_tracker_are_behind_for_one_frame() -> None:
    arrivals_s = [100.0, 100.02, *(101.0 + 0.02 * number for number in range(5))]
    assert frames_behind(arrivals_s, list(range(7))) == [2]


def test_poses_with_jitter_and_missing_frames_are_not_behind() -> None:
    frames = [frame for frame in range(200) if frame % 7]
    arrivals_s = [100.0 + 0.02 * frame + (0.019 if frame % 5 == 0 else 0.0) for frame in frames]
    assert not frames_behind(arrivals_s, frames)


def test_missing_frames_make_the_next_pose_no_later() -> None:
    frames = [0, 1, 5, 6, 9]
    assert delays_s([0.02 * frame for frame in frames], frames) == pytest.approx([0.0] * 5, abs=1e-3)


def test_a_stream_that_is_slower_than_it_says_is_not_late() -> None:
    assert max(delays_s([0.0201 * frame for frame in range(1000)])) < 1e-6


def test_a_lasting_delay_is_no_lateness_in_the_long_run() -> None:
    delays = delays_s([0.02 * frame + (0.05 if frame >= 10 else 0.0) for frame in range(500)])
    assert delays[10] > 0.045
    assert delays[-1] == 0.0


def test_a_stream_that_pauses_or_begins_anew_is_not_late() -> None:
    assert delays_s([0.0, 0.02, 7.0, 7.02], [0, 1, 2, 3]) == pytest.approx([0.0] * 4, abs=1e-3)
    assert delays_s([0.0, 0.02, 0.04, 0.06], [700, 701, 1, 2]) == pytest.approx([0.0] * 4, abs=1e-3)


def test_at_half_rate_every_second_period_is_left_out_and_none_is_missed() -> None:
    pacing = Pacing(0.02)
    due(pacing, [100], 0.01)
    pacing.every = 2
    assert due(pacing, range(101, 121), 0.01) == [104, 108, 112, 116, 120]
    assert [frame for frame in range(101, 105) if pacing.left_out(frame)] == [102, 104]
    assert pacing.missed_ticks == 0
    pacing.every = 1
    assert not pacing.left_out(122)
    assert due(pacing, range(121, 127), 0.01) == [122, 124, 126]


@pytest.mark.parametrize(("place", "frames"), [(0, [104, 108]), (1, [102, 106]), (5, [102, 106])])
def test_at_half_rate_neighbours_in_the_fleet_take_turns(place: int, frames: list[int]) -> None:
    pacing = Pacing(0.02, place)
    pacing.every = 2
    due(pacing, [100], 0.01)
    assert due(pacing, range(101, 110), 0.01) == frames
    assert pacing.missed_ticks == 0


def test_at_half_rate_a_plan_of_the_period_before_is_new_enough() -> None:
    pacing = Pacing(0.02)
    pacing.on_pose(0, 0.0, 0.01)
    assert pacing.plan_frame(100) == 100
    pacing.every = 2
    assert pacing.plan_frame(100) == 96


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("every", [2, 4])
def test_at_a_lower_rate_rest_ends_between_the_last_frame_without_control_and_the_next_with_it(
    place: int, every: int
) -> None:
    pacing = Pacing(0.02, place)
    assert pacing.rest_s(100) == 0.0
    pacing.every = every
    (*_, last) = due(pacing, range(100, 120), 0.01)
    assert pacing.rest_s(last + 1) == 0.0
    assert pacing.rest_s(last) == pytest.approx(every * 0.02 - 0.005)


def test_after_a_gap_rest_ends_before_the_next_turn() -> None:
    pacing = Pacing(0.02, place=1)
    pacing.every = 4
    assert due(pacing, [100, 103], 0.02) == [100]
    assert due(pacing, [104], 0.02) == [104]
    assert pacing.rest_s(104) == pytest.approx(0.5 * 0.02)


def test_at_full_rate_nobody_rests() -> None:
    pacing = Pacing(0.02)
    due(pacing, [100], 0.01)
    assert pacing.rest_s(100) == 0.0
