"""Promises of the bus over a real router: what is published arrives, requests are answered."""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import asdict, replace

import msgpack
import pytest
import zenoh
from support.bus import RouterProcess, answering, own_address, raw_put, raw_session
from support.statuses import flying_status
from support.waiting import DEADLINE_S, FakeClock, wait_for

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import TrackerStatus
from rcopterx.bus.messages import Kill, Pose, SetPoint
from rcopterx.bus.requests import Arm, GoTo, Land, Lead, Recall, RecallReply, Reply, Request
from rcopterx.bus.session import (
    BusAddress,
    BusUnreachableError,
    Incoming,
    RequestFailedError,
    Session,
)
from rcopterx.bus.subscription import Inbox

Join = Callable[..., Session]

LEFT_OPEN_CODE = """
import json, sys
from rcopterx.bus import channels
from rcopterx.bus.session import BusAddress, Session
table = json.loads(sys.argv[1])
session = Session(BusAddress(tuple(table["endpoints"]), table["fleet"], table["namespace"]), timeout_s=60.0)
inbox = session.subscribe_all(channels.POSE)
"""


def pose(frame: int) -> Pose:
    return Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=True)


def arrives(sender: Session, inbox: Inbox[Pose], frame: int) -> None:
    """Publish until a pose gets through: the first put after a declaration may be lost."""

    def through() -> bool:
        sender.publish(channels.POSE, "h1", pose(frame))
        received = inbox.latest()
        return received is not None and received.message.frame == frame

    wait_for(through, f"frame {frame} does not arrive")


def answer_of(asker: Session, unit: str, request: Lead | Land | GoTo | Recall | Arm) -> Reply:
    """Send a request as soon as it is served."""
    replies: list[Reply] = []
    problems: list[str] = []

    def answered() -> bool:
        try:
            replies.append(asker.request(unit, request, timeout_s=DEADLINE_S))
        except RequestFailedError as error:
            problems.append(str(error))
            return False
        return True

    wait_for(answered, "no answer")
    assert all("no process serves" in problem for problem in problems)
    return replies[0]


def test_a_published_message_arrives_typed_with_its_time_and_wakes_the_loop(join: Join) -> None:
    clock, woken = FakeClock(50.0), threading.Event()
    receiver, sender = join(wake=woken.set, clock=clock), join()
    inbox = receiver.subscribe(channels.POSE, "h1")
    arrives(sender, inbox, 7)
    received = inbox.latest()
    assert received is not None
    assert received.message == pose(7)
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

    receiver, sender = join(wake=lambda: woken.append("woken")), join()
    receiver.subscribe(channels.POSE, "h1", waking=waking)

    def decided_twice() -> bool:
        sender.publish(channels.POSE, "h1", pose(1))
        return len(decisions) > 1

    wait_for(decided_twice, "no poses arrive")
    assert woken == ["woken"]


def test_messages_of_other_units_and_topics_do_not_arrive(join: Join) -> None:
    receiver, sender = join(), join()
    inbox = receiver.subscribe(channels.POSE, "h1")
    arrives(sender, inbox, 1)
    sender.publish(channels.POSE, "h2", pose(100))
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
            sender.publish(channels.POSE, unit, pose(frame))
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
            stranger.put(key, encode(pose(666)))
            return inbox.rejected["key"] > 0 and units.rejected["key"] > 0

        wait_for(counted, "the wildcard put is not counted")
    for unit in (inbox, units.inboxes["h1"]):
        received = unit.latest()
        assert received is not None
        assert received.message.frame == 1
    assert key in inbox.reason


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
        sender.publish(channels.POSE, "h1", pose(1))
        raw_put(bus_address, "rcopterx/lab/h2/plan", b"\xc1")
        return {("h1", "pose", encode(pose(1))), ("h2", "plan", b"\xc1")} <= set(received_raw)

    wait_for(both_arrived, "not everything arrives")
    assert {unit for unit, _, _ in received_raw} == {"h1", "h2"}


def test_units_that_the_fleet_does_not_have_take_no_memory(join: Join, bus_address: BusAddress) -> None:
    with Session(replace(bus_address, units=frozenset({"h1"})), timeout_s=DEADLINE_S) as receiver:
        sender, tapped = join(), set[str]()
        receiver.tap(lambda message: tapped.add(message.unit))
        units = receiver.subscribe_all(channels.POSE)

        def all_arrived() -> bool:
            for number in range(100):
                sender.publish(channels.POSE, f"stranger{number}", pose(1))
            sender.publish(channels.POSE, "h1", pose(1))
            return units.rejected["unit"] >= 100 and "h1" in units.inboxes

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


def test_a_request_reaches_its_unit_typed_and_the_typed_reply_comes_back(join: Join) -> None:
    server, asker = join(), join()
    server.serve("h1", ["go_to"])
    requests: list[object] = []

    def reply(request: object) -> Reply:
        requests.append(request)
        return Reply(accepted=False, reason="outside the flight volume")

    request = GoTo(set_point=SetPoint(position_m=(1.0, 2.0, 3.0), yaw_rad=0.5))
    with answering(server, reply):
        answer = answer_of(asker, "h1", request)
    assert answer == Reply(accepted=False, reason="outside the flight volume")
    assert requests == [request]


def test_a_reply_may_have_its_own_type(join: Join) -> None:
    server, asker = join(), join()
    server.serve("h1", ["recall"])
    with answering(server, lambda _: RecallReply(accepted=True, age_s=1.5)):
        answer = answer_of(asker, "h1", Recall(vehicle="h1"))
    assert answer == RecallReply(accepted=True, age_s=1.5)


def test_a_session_serves_several_units_and_verbs(join: Join) -> None:
    server, asker = join(), join()
    for unit in ("h1", "h2"):
        server.serve(unit, ["lead", "land"])
    seen: list[str] = []

    def work(request: object) -> Reply:
        seen.append(type(request).__name__)
        return Reply(accepted=True)

    with answering(server, work):
        assert answer_of(asker, "h2", Lead()).accepted
        assert answer_of(asker, "h1", Land()).accepted
    assert seen == ["Lead", "Land"]


def test_a_request_without_a_server_fails_at_once_and_says_so(join: Join) -> None:
    with pytest.raises(RequestFailedError, match="no process serves land for h9"):
        join().request("h9", Land(), timeout_s=DEADLINE_S)


def test_a_request_of_a_closed_session_fails_in_words(join: Join) -> None:
    session = join()
    session.close()
    with pytest.raises(RequestFailedError, match="land was not sent to h1"):
        session.request("h1", Land())


def test_a_request_that_is_not_answered_in_time_fails_says_so_and_is_not_repeated(join: Join) -> None:
    server, asker = join(), join()
    server.serve("h1", ["land", "lead"])
    with answering(server, lambda _: Reply(accepted=True)):
        answer_of(asker, "h1", Lead())
    for _ in range(40):
        with pytest.raises(RequestFailedError, match="h1 did not answer land"):
            asker.request("h1", Land(), timeout_s=0.02)
    arrived: list[Incoming] = []

    def all_arrived() -> bool:
        arrived.extend(server.pending())
        return len(arrived) >= 40

    wait_for(all_arrived, "not every request arrives")
    later: list[Request] = []

    def reply(request: Request) -> Reply:
        later.append(request)
        return Reply(accepted=True)

    with answering(server, reply):
        answer_of(asker, "h1", Lead())
    # What was sent before arrives before.
    assert len(arrived) == 40
    assert later == [Lead()]


def test_an_answer_that_comes_too_late_does_no_harm(join: Join) -> None:
    server, asker = join(), join()
    server.serve("h1", ["land", "lead"])
    with answering(server, lambda _: Reply(accepted=True)):
        answer_of(asker, "h1", Lead())
    with pytest.raises(RequestFailedError):
        asker.request("h1", Land(), timeout_s=0.05)
    late: list[Incoming] = []

    def arrived() -> bool:
        late.extend(server.pending())
        return bool(late)

    wait_for(arrived, "the request does not arrive")
    assert [type(incoming.request) for incoming in late] == [Land]
    late[0].answer(Reply(accepted=True))
    with answering(server, lambda _: Reply(accepted=True)):
        assert asker.request("h1", Land(), timeout_s=DEADLINE_S).accepted


@pytest.mark.parametrize("payload", [b"", b"garbage", msgpack.packb({"set_point": {"position_m": [1, 2]}})])
def test_a_malformed_request_is_refused_with_the_reason_and_never_handled(
    join: Join, bus_address: BusAddress, payload: bytes
) -> None:
    server = join()
    server.serve("h1", ["go_to"])
    key = channels.request_key("lab", "h1", "go_to")
    texts: list[str] = []
    with raw_session(bus_address) as stranger:

        def refused() -> bool:
            replies = list(stranger.get(key, payload=payload, timeout=DEADLINE_S))
            texts.extend(reply.err.payload.to_bytes().decode() for reply in replies if reply.err is not None)
            return bool(texts)

        wait_for(refused, "no refusal")
    assert texts[0].startswith("go_to: ")
    assert server.pending() == []


def test_a_process_that_handles_nothing_turns_further_requests_away(
    join: Join, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.bus.session.MOST_REQUESTS", 0)
    server, asking = join(), join()
    server.serve("h1", ["land"])
    with pytest.raises(RequestFailedError, match="land: 0 requests are waiting already"):
        asking.request("h1", Land(), timeout_s=DEADLINE_S, patience_s=DEADLINE_S)
    assert server.pending() == []


def test_a_malformed_answer_fails_the_request_and_nothing_else_is_raised(
    join: Join, bus_address: BusAddress
) -> None:
    asker = join()
    with raw_session(bus_address) as stranger:
        key = channels.request_key("lab", "h1", "land")

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(key, b"garbage")

        served = stranger.declare_queryable(key, answer)

        def answered_wrongly() -> bool:
            with pytest.raises(RequestFailedError) as caught:
                asker.request("h1", Land(), timeout_s=DEADLINE_S)
            return "h1 answered land with an invalid reply" in str(caught.value)

        wait_for(answered_wrongly, "the malformed answer does not arrive")
        served.undeclare()


def test_a_session_without_a_router_says_where_and_for_how_long_it_tried() -> None:
    address = own_address()
    with pytest.raises(BusUnreachableError) as caught:
        Session(address, timeout_s=0.2)
    assert address.endpoints[0] in str(caught.value)
    assert "0.2 s" in str(caught.value)
    assert ".rs:" not in str(caught.value)


def test_sessions_see_each_other_again_after_the_router_was_killed() -> None:
    address = own_address()
    router = RouterProcess(address)
    try:
        router.wait_ready()
        with (
            Session(address, timeout_s=DEADLINE_S) as receiver,
            Session(address, timeout_s=DEADLINE_S) as sender,
        ):
            inbox = receiver.subscribe(channels.POSE, "h1")
            receiver.serve("h1", ["land"])
            arrives(sender, inbox, 1)
            router.end(signal.SIGKILL)
            sender.publish(channels.POSE, "h1", pose(2))
            with pytest.raises(RequestFailedError):
                sender.request("h1", Land())
            router = RouterProcess(address)
            arrives(sender, inbox, 3)
            with answering(receiver, lambda _: Reply(accepted=True)):
                assert answer_of(sender, "h1", Land()).accepted
    finally:
        router.end()


def test_a_router_ends_cleanly_on_sigterm() -> None:
    address = own_address()
    router = RouterProcess(address)
    try:
        router.wait_ready()
    finally:
        code = router.end(signal.SIGTERM)
    assert code == 0


def test_an_endpoint_that_is_not_there_does_not_keep_a_session_from_the_next(bus_address: BusAddress) -> None:
    missing = ("unixsock-stream//nowhere/router.sock", own_address().endpoints[0])
    address = BusAddress((*missing, *bus_address.endpoints), bus_address.fleet, bus_address.namespace)
    with Session(address, timeout_s=DEADLINE_S) as session, Session(bus_address) as other:
        arrives(session, other.subscribe(channels.POSE, "h1"), 1)


def test_a_session_waits_for_a_router_that_is_being_started() -> None:
    address = own_address()
    router = RouterProcess(address)
    try:
        with Session(address, timeout_s=DEADLINE_S) as session, Session(address) as other:
            arrives(session, other.subscribe(channels.POSE, "h1"), 1)
    finally:
        router.end()


def test_a_program_that_never_left_the_bus_ends_without_a_word(bus_address: BusAddress) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", LEFT_OPEN_CODE, json.dumps(asdict(bus_address), default=list)],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_leaving_the_bus_twice_is_leaving_it_once(bus_address: BusAddress) -> None:
    with Session(bus_address, timeout_s=DEADLINE_S) as session:
        session.close()
        session.close()
