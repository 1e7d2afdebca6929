"""Promises of the bus over a real router: requests are answered, or fail with the reason."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import msgpack
import pytest
import zenoh
from support.bus import answer_of, answering, raw_session
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus import channels
from rcopterx.bus.clock import Clock
from rcopterx.bus.messages import SetPoint
from rcopterx.bus.requests import Disarm, GoTo, Land, Lead, Recall, RecallReply, Reply, Request
from rcopterx.bus.session import (
    BusAddress,
    Incoming,
    NotServedError,
    RequestFailedError,
    Session,
)

Join = Callable[..., Session]


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


def test_a_request_whose_server_is_lost_while_it_waits_reaches_the_successor(join: Join) -> None:
    patience_s = 0.3
    first, successor, asker, other = join(), join(), join(), join()
    first.serve("h1", ["land", "lead"])
    with answering(first, lambda _: Reply(accepted=True)):
        answer_of(asker, "h1", Lead())

    def hang_and_end() -> None:
        wait_for(first.pending, "the request does not arrive")
        time.sleep(2 * patience_s)  # The wait for a reply must not use up the patience.
        successor.serve("h1", ["land", "disarm"])
        answer_of(other, "h1", Disarm())
        first.close()

    end = threading.Thread(target=hang_and_end)
    end.start()
    with answering(successor, lambda _: Reply(accepted=True, reason="successor")):
        reply = asker.request("h1", Land(), timeout_s=DEADLINE_S, patience_s=patience_s)
    end.join()
    assert reply == Reply(accepted=True, reason="successor")


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


def test_a_successor_has_the_whole_patience_to_start_in_a_fleet_that_is_faster_than_real_time(
    bus_address: BusAddress,
) -> None:
    patience_s, resolution_s = 0.2, 0.001
    with Session(replace(bus_address, clock=Clock(10.0)), timeout_s=DEADLINE_S) as asker:
        began_s = time.monotonic()
        with pytest.raises(NotServedError):
            asker.request("h1", Land(), timeout_s=DEADLINE_S, patience_s=patience_s)
    assert time.monotonic() - began_s > patience_s - resolution_s
