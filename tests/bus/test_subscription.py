"""Promises of inboxes: newest message, its age on the local clock, and every refusal counted."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import Command, Pose
from rcopterx.bus.subscription import Inbox


def pose(frame: int) -> bytes:
    return encode(Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=True))


def test_an_inbox_without_a_message_is_silent() -> None:
    inbox = Inbox(channels.POSE)
    assert inbox.latest() is None
    assert inbox.age_s(5.0) is None
    assert not inbox.alive(5.0)


def test_age_is_counted_from_the_arrival_on_the_local_clock() -> None:
    inbox = Inbox(channels.POSE)
    inbox.store(pose(1), 100.0)
    assert inbox.age_s(100.25) == pytest.approx(0.25)
    assert inbox.age_s(99.0) == 0.0


def test_messages_wait_from_the_arrival_of_the_oldest_until_they_are_read() -> None:
    inbox = Inbox(channels.POSE, depth=4)
    assert inbox.waiting_since_s() is None
    inbox.store(pose(1), 100.0)
    inbox.store(pose(2), 101.0)
    assert inbox.waiting_since_s() == 100.0
    inbox.drain()
    assert inbox.waiting_since_s() is None


def test_a_sender_is_alive_until_its_channel_counts_as_stale() -> None:
    inbox = Inbox(channels.POSE)
    inbox.store(pose(1), 100.0)
    limit_s = channels.POSE.stale_after_s
    assert inbox.alive(100.0 + limit_s - 1e-6)
    assert not inbox.alive(100.0 + limit_s + 1e-6)


def test_a_message_that_is_refused_does_not_count_as_a_sign_of_life() -> None:
    inbox = Inbox(channels.POSE)
    inbox.store(pose(1), 100.0)
    inbox.store(b"garbage", 101.0)
    assert inbox.age_s(101.0) == pytest.approx(1.0) or inbox.age_s(101.0) is None
    assert not inbox.alive(101.0)
    assert inbox.rejected["malformed"] + inbox.rejected["type"] == 1


def test_the_newest_message_stays_until_a_newer_valid_one_arrives() -> None:
    inbox = Inbox(channels.POSE)
    inbox.store(pose(1), 100.0)
    first = inbox.latest()
    assert first is not None
    inbox.store(b"\xc1", 100.02)
    assert inbox.latest() is first
    inbox.store(pose(2), 100.04)
    newest = inbox.latest()
    assert newest is not None
    assert (newest.message.frame, newest.arrived_s) == (2, 100.04)


def test_an_inbox_of_depth_one_replaces_without_counting() -> None:
    inbox = Inbox(channels.POSE)
    for frame in range(5):
        inbox.store(pose(frame), float(frame))
    assert [received.message.frame for received in inbox.drain()] == [4]
    assert not inbox.rejected


def test_a_deep_inbox_hands_over_everything_in_order_and_counts_what_it_lost() -> None:
    inbox = Inbox(channels.POSE, depth=3)
    for frame in range(5):
        inbox.store(pose(frame), float(frame))
    assert [received.message.frame for received in inbox.drain()] == [2, 3, 4]
    assert inbox.drain() == []
    assert inbox.rejected["overrun"] == 2


def test_what_a_limited_reading_leaves_waits_for_the_next_one() -> None:
    inbox = Inbox(channels.POSE, depth=4)
    inbox.store(b"\xc1", 0.0)
    for frame in range(3):
        inbox.store(pose(frame), float(frame))
    assert [received.message.frame for received in inbox.drain(2)] == [0]
    assert inbox.waiting_since_s() == 1.0
    assert [received.message.frame for received in inbox.drain(2)] == [1, 2]
    assert inbox.drain(2) == []


@given(st.lists(st.sampled_from(["size", "malformed", "type", "value"]), max_size=20))
def test_every_refusal_is_counted_under_its_kind(kinds: list[str]) -> None:
    inbox = Inbox(channels.COMMAND)
    bad = {
        "size": bytes(Command.MAX_BYTES + 1),
        "malformed": b"\xc1",
        "type": b"\x80",
        "value": encode(
            Command(
                epoch=0, frame=0, lease=1, sequence=0, input=(0.0, 0.0, 0.5, 0.0),
                next_inputs=FloatArray.of(np.zeros((1, 3))), period_s=0.02,
            )
        ),
    }  # fmt: skip
    for kind in kinds:
        inbox.store(bad[kind], 0.0)
        assert inbox.latest() is None
    assert inbox.rejected == {kind: kinds.count(kind) for kind in set(kinds)}


def test_rejections_can_be_read_while_a_receive_thread_counts_new_kinds() -> None:
    inbox = Inbox(channels.POSE)
    kinds = [f"kind {number}" for number in range(3000)]
    writer = threading.Thread(target=lambda: [inbox.reject(kind) for kind in kinds])
    writer.start()
    seen = 0
    while writer.is_alive() or seen < len(kinds):
        counts = dict(inbox.rejected.items())
        assert len(counts) >= seen
        seen = len(counts)
    writer.join()
