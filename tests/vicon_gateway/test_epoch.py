import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.vicon_gateway.frame import CapturedFrame, EpochCounter, Stamp, SubjectPose

PERIOD_S = 0.02


def frame(number: int, received_s: float, connection: int = 1, x_m: float | None = None) -> CapturedFrame:
    """A frame with a body that moves; with `x_m` it is there."""
    position = (received_s if x_m is None else x_m, 0.0, 1.0)
    pose = SubjectPose("h1", False, position, (0.0, 0.0, 0.0, 1.0), None)
    return CapturedFrame(number, connection, PERIOD_S, received_s, 0.0, (pose,))


def started(number: int = 1000, received_s: float = 50.0) -> EpochCounter:
    counter = EpochCounter()
    assert counter.stamp(frame(number, received_s), 1_700_000_000.5) == Stamp(1_700_000_000_500, number)
    return counter


def test_epoch_is_the_wall_clock_in_milliseconds_at_the_first_frame_and_stays() -> None:
    counter = started()
    assert counter.stamp(frame(1001, 50.02), 1_800_000_000.0) == Stamp(1_700_000_000_500, 1001)
    assert counter.epochs == 1


def test_frame_number_that_jumps_back_begins_a_new_epoch() -> None:
    counter = started()
    assert counter.stamp(frame(3, 50.02), 1_700_000_100.0) == Stamp(1_700_000_100_000, 3)
    assert counter.epochs == 2


def test_lost_frames_keep_the_epoch() -> None:
    assert started().stamp(frame(1005, 50.1), 0.0) == Stamp(1_700_000_000_500, 1005)


def test_late_and_bunched_frames_keep_the_epoch() -> None:
    counter = started()
    for number, received_s in ((1001, 50.2), (1002, 50.2), (1010, 50.2), (1011, 50.22)):
        assert counter.stamp(frame(number, received_s), 0.0) == Stamp(1_700_000_000_500, number)


def test_frames_from_the_future_begin_a_new_epoch() -> None:
    counter = started()
    counter.stamp(frame(100_000, 50.02), 1_700_000_100.0)
    assert counter.epochs == 2


@pytest.mark.parametrize("outage_s", [0.1, 1.0, 60.0, 3600.0])
def test_reconnect_whose_frames_went_on_meanwhile_keeps_the_epoch(outage_s: float) -> None:
    counter = started()
    later = frame(1000 + round(outage_s / PERIOD_S), 50.0 + outage_s, connection=2)
    assert counter.stamp(later, 1_800_000_000.0) == Stamp(1_700_000_000_500, later.frame)


@pytest.mark.parametrize(
    ("number", "outage_s"),
    [(0, 1.0), (999, 0.1), (1001, 5.0), (1000, 5.0), (5000, 5.0), (1200, 5.0)],
)
def test_reconnect_whose_frames_do_not_fit_the_time_begins_a_new_epoch(number: int, outage_s: float) -> None:
    counter = started()
    stamp = counter.stamp(frame(number, 50.0 + outage_s, connection=2), 1_700_000_100.0)
    assert stamp == Stamp(1_700_000_100_000, number)


def test_capture_delivered_again_after_a_reconnect_gets_no_second_stamp() -> None:
    counter = started()
    assert counter.stamp(frame(1000, 50.05, connection=2), 0.0) is None
    assert counter.stamp(frame(1003, 50.06, connection=2), 0.0) == Stamp(1_700_000_000_500, 1003)


def test_frozen_tracker_gets_no_new_stamp_however_often_it_is_asked_and_goes_on_in_its_epoch() -> None:
    counter = EpochCounter()
    assert counter.stamp(frame(1000, 50.0, x_m=0.5), 1.0) == Stamp(1000, 1000)
    for connection in range(2, 20):
        assert counter.stamp(frame(1000, 50.0 + 0.3 * connection, connection, x_m=0.5), 2.0) is None
    assert counter.stamp(frame(1300, 56.0, 20, x_m=0.6), 3.0) == Stamp(1000, 1300)
    assert counter.epochs == 1


def test_wall_clock_set_back_still_gives_a_later_epoch() -> None:
    counter = started()
    first = counter.stamp(frame(1, 50.02), 1_000.0)
    second = counter.stamp(frame(0, 50.04), 1_000.0)
    assert first == Stamp(1_700_000_000_501, 1)
    assert second == Stamp(1_700_000_000_502, 0)


@given(
    st.lists(
        st.tuples(st.integers(0, 2**32 - 2), st.floats(0.0, 100.0), st.booleans(), st.floats(0.0, 4e9)),
        max_size=30,
    )
)
def test_stamps_always_grow(sequence: list[tuple[int, float, bool, float]]) -> None:
    counter = EpochCounter()
    received_s, connection = 0.0, 1
    stamps = []
    for number, elapsed_s, reconnected, wall_clock_s in sequence:
        received_s += elapsed_s
        connection += reconnected
        stamp = counter.stamp(frame(number, received_s, connection), wall_clock_s)
        if stamp is not None:
            stamps.append(stamp)
    assert all(earlier < later for earlier, later in itertools.pairwise(stamps))


def test_epoch_of_another_gateway_is_left_behind_whatever_the_wall_clock_says() -> None:
    counter = EpochCounter()
    counter.leave_behind(1_800_000_000_000)
    assert counter.epoch == 0
    assert counter.stamp(frame(7, 50.0), 1_700_000_000.0) == Stamp(1_800_000_000_001, 7)
    assert counter.stamp(frame(8, 50.02), 1_700_000_000.02) == Stamp(1_800_000_000_001, 8)
    assert counter.epochs == 1


@pytest.mark.parametrize("epoch", [2**52 + 1, 2**53, 2**64 - 1])
def test_epoch_that_leaves_no_room_for_later_ones_is_not_left_behind(epoch: int) -> None:
    counter = EpochCounter()
    counter.leave_behind(epoch)
    assert counter.stamp(frame(7, 50.0), 1_700_000_000.0) == Stamp(1_700_000_000_000, 7)


def test_newer_epoch_of_another_gateway_begins_a_new_one_and_an_older_one_does_not() -> None:
    counter = started()
    counter.leave_behind(1_700_000_000_500)
    assert counter.stamp(frame(1001, 50.02), 0.0) == Stamp(1_700_000_000_500, 1001)
    counter.leave_behind(1_700_000_000_501)
    assert counter.stamp(frame(1002, 50.04), 0.0) == Stamp(1_700_000_000_502, 1002)
    counter.leave_behind(1_000)
    assert counter.stamp(frame(1003, 50.06), 0.0) == Stamp(1_700_000_000_502, 1003)
    assert counter.epoch == 1_700_000_000_502
