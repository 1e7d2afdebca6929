"""Promises of the bus over a real router: what is published arrives."""

import threading
from collections.abc import Callable
from dataclasses import replace

import msgpack
import pytest
from support.bus import Calls, arrives, occluded_pose, raw_put, raw_session
from support.statuses import flying_status
from support.waiting import DEADLINE_S, FakeClock, wait_for

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import TrackerStatus
from rcopterx.bus.messages import Kill, Pose
from rcopterx.bus.session import (
    BusAddress,
    Session,
)

Join = Callable[..., Session]


def test_a_published_message_arrives_typed_with_its_time_and_wakes_the_loop(join: Join) -> None:
    clock, woken = FakeClock(50.0), threading.Event()
    receiver, sender = join(waiter=Calls(woken.set), clock=clock), join()
    inbox = receiver.subscribe(channels.POSE, "h1")
    arrives(sender, inbox, 7)
    received = inbox.latest()
    assert received is not None
    assert received.message == occluded_pose(7)
    assert received.arrived_s == 50.0
    assert woken.is_set()
    clock.advance(1.0)
    assert inbox.age_s(clock()) == 1.0
    assert not inbox.alive(clock())


def test_a_subscription_can_decide_for_each_message_whether_it_wakes_the_loop(join: Join) -> None:
    woken: list[str] = []
    decisions: list[bool] = []

    def waking() -> bool:
        decisions.append(not decisions)
        return decisions[-1]

    receiver, sender = join(waiter=Calls(lambda: woken.append("woken"))), join()
    receiver.subscribe(channels.POSE, "h1", waking=waking)

    def decided_twice() -> bool:
        sender.publish(channels.POSE, "h1", occluded_pose(1))
        return len(decisions) > 1

    wait_for(decided_twice, "no poses arrive")
    assert woken == ["woken"]


def test_messages_of_other_units_and_topics_do_not_arrive(join: Join) -> None:
    receiver, sender = join(), join()
    inbox = receiver.subscribe(channels.POSE, "h1")
    arrives(sender, inbox, 1)
    sender.publish(channels.POSE, "h2", occluded_pose(100))
    sender.publish(channels.KILL, "h1", Kill(source="gcs", reason="x"))
    arrives(sender, inbox, 2)
    assert not inbox.rejected


def test_a_subscription_can_leave_out_what_its_own_session_publishes(join: Join) -> None:
    session, other = join(), join()
    everything = session.subscribe(channels.KILL, "fleet", depth=8)
    from_others = session.subscribe(channels.KILL, "fleet", depth=8, own=False)
    session.publish(channels.KILL, "fleet", Kill(source="session", reason="test"))
    wait_for(lambda: everything.latest() is not None, "its own message comes back")

    def arrived() -> bool:
        # Its own messages come back without the router, which may not know the subscriptions yet.
        other.publish(channels.KILL, "fleet", Kill(source="other", reason="test"))
        return from_others.waiting_since_s() is not None

    wait_for(arrived, "a message of the other session arrives")
    assert {received.message.source for received in from_others.drain()} == {"other"}


def test_a_closed_subscription_receives_nothing_more(join: Join) -> None:
    receiver, sender = join(), join()
    closed, open_ = receiver.subscribe(channels.POSE, "h1"), receiver.subscribe(channels.POSE, "h1")
    arrives(sender, closed, 1)
    closed.close()
    arrives(sender, open_, 2)
    received = closed.latest()
    assert received is not None
    assert received.message.frame == 1


def test_subscribe_all_keeps_an_inbox_for_every_unit(join: Join) -> None:
    receiver, sender = join(), join()
    units = receiver.subscribe_all(channels.POSE)

    def both_seen() -> bool:
        for unit, frame in (("h1", 1), ("h2", 2)):
            sender.publish(channels.POSE, unit, occluded_pose(frame))
        return set(units.inboxes) == {"h1", "h2"}

    wait_for(both_seen, "not both units are seen")
    newest = {name: inbox.latest() for name, inbox in units.inboxes.items()}
    assert {name: value.message.frame for name, value in newest.items() if value} == {"h1": 1, "h2": 2}
    units.close()


def test_what_the_tracker_says_of_itself_is_no_status_of_a_vehicle(join: Join) -> None:
    receiver, sender = join(), join()
    statuses = receiver.subscribe_all(channels.AGENT_STATUS)
    tracker = receiver.subscribe(channels.TRACKER_STATUS, channels.TRACKER_UNIT)
    message = TrackerStatus(state="streaming", trying="", address="")

    def both_arrived() -> bool:
        sender.publish(channels.TRACKER_STATUS, channels.TRACKER_UNIT, message)
        sender.publish(channels.AGENT_STATUS, "h1", flying_status())
        return tracker.latest() is not None and len(statuses.inboxes) > 0

    wait_for(both_arrived, "not both statuses arrive")
    assert set(statuses.inboxes) == {"h1"}


@pytest.mark.parametrize(
    "key", ["rcopterx/lab/*/pose", "rcopterx/lab/h1/*", "rcopterx/**", "rcopterx/lab/h$*/pose"]
)
def test_messages_put_on_a_wildcard_key_are_refused_and_counted(
    join: Join, bus_address: BusAddress, key: str
) -> None:
    receiver, sender = join(), join()
    inbox, units = receiver.subscribe(channels.POSE, "h1"), receiver.subscribe_all(channels.POSE)
    arrives(sender, inbox, 1)
    wait_for(lambda: units.inboxes, "no unit is seen")
    with raw_session(bus_address) as stranger:

        def counted() -> bool:
            stranger.put(key, encode(occluded_pose(666)))
            return inbox.rejected["key"] > 1  # all subscriptions have received the first one

        wait_for(counted, "the wildcard put is not counted")
    for unit in (inbox, units.inboxes["h1"]):
        received = unit.latest()
        assert received is not None
        assert received.message.frame == 1


def test_malformed_messages_from_the_bus_are_counted_and_the_last_good_one_stays(
    join: Join, bus_address: BusAddress
) -> None:
    receiver, sender = join(), join()
    inbox = receiver.subscribe(channels.POSE, "h1", depth=8)
    arrives(sender, inbox, 1)
    with raw_session(bus_address) as stranger:

        def counted() -> bool:
            for payload in (b"\xc1", msgpack.packb({"epoch": "x"}), bytes(Pose.MAX_BYTES + 1)):
                stranger.put(channels.key("lab", "h1", "pose"), payload)
            inbox.latest()
            return {"malformed", "type", "size"} <= set(inbox.rejected)

        wait_for(counted, "not every kind is counted")
    received = inbox.latest()
    assert received is not None
    assert received.message.frame == 1


def test_a_tap_receives_every_unit_undecoded_and_survives_strange_keys(
    join: Join, bus_address: BusAddress
) -> None:
    received_raw: list[tuple[str, str, bytes]] = []
    recorder, sender = join(), join()
    recorder.tap(lambda message: received_raw.append((message.unit, message.topic, message.payload)))
    for key in ("rcopterx/**", "rcopterx/lab/*/pose", "rcopterx/lab/h1/request/land"):
        raw_put(bus_address, key, b"x")

    def both_arrived() -> bool:
        sender.publish(channels.POSE, "h1", occluded_pose(1))
        raw_put(bus_address, "rcopterx/lab/h2/plan", b"\xc1")
        return {("h1", "pose", encode(occluded_pose(1))), ("h2", "plan", b"\xc1")} <= set(received_raw)

    wait_for(both_arrived, "not everything arrives")
    assert {unit for unit, _, _ in received_raw} == {"h1", "h2"}


def test_units_that_the_fleet_does_not_have_take_no_memory(join: Join, bus_address: BusAddress) -> None:
    with Session(replace(bus_address, units=frozenset({"h1"})), timeout_s=DEADLINE_S) as receiver:
        sender, other, tapped = join(), join().subscribe_all(channels.POSE), set[str]()
        receiver.tap(lambda message: tapped.add(message.unit))
        units = receiver.subscribe_all(channels.POSE)

        def all_arrived() -> bool:
            for number in range(100):
                sender.publish(channels.POSE, f"stranger{number}", occluded_pose(1))
            sender.publish(channels.POSE, "h1", occluded_pose(1))
            return len(other.inboxes) > 100 and "h1" in units.inboxes

        wait_for(all_arrived, "not everything arrives")
        assert set(units.inboxes) == tapped == {"h1"}


def test_namespaces_keep_fleets_apart(join: Join, bus_address: BusAddress) -> None:
    another = BusAddress(bus_address.endpoints, bus_address.fleet, "another")
    with Session(another, timeout_s=DEADLINE_S) as other:
        receiver, sender = join(), join()
        inbox, foreign = receiver.subscribe(channels.POSE, "h1"), other.subscribe(channels.POSE, "h1")
        arrives(sender, inbox, 1)
        arrives(other, foreign, 5)
        arrives(sender, inbox, 2)
        assert inbox.rejected == foreign.rejected == {}
        received = foreign.latest()
        assert received is not None
        assert received.message.frame == 5
