"""Promises of the bus: sessions find a router, come back to a new one, and leave."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict

import pytest
from support.bus import RouterProcess, answer_of, answering, arrives, occluded_pose, own_address
from support.waiting import DEADLINE_S

from rcopterx.bus import channels
from rcopterx.bus.requests import Land, Reply
from rcopterx.bus.session import (
    BusAddress,
    BusUnreachableError,
    RequestFailedError,
    Session,
)

LEFT_OPEN_CODE = """
import json, sys
from rcopterx.bus import channels
from rcopterx.bus.session import BusAddress, Session
table = json.loads(sys.argv[1])
session = Session(BusAddress(tuple(table["endpoints"]), table["fleet"], table["namespace"]), timeout_s=60.0)
inbox = session.subscribe_all(channels.POSE)
"""


def test_a_session_without_a_router_says_where_and_for_how_long_it_tried() -> None:
    address = own_address()
    with pytest.raises(BusUnreachableError) as caught:
        Session(address, timeout_s=0.2)
    assert address.endpoints[0] in str(caught.value)
    assert "0.2 s" in str(caught.value)
    assert ".rs:" not in str(caught.value)


def test_attempts_to_find_a_router_leave_no_descriptors_open() -> None:
    def attempt() -> int:
        with pytest.raises(BusUnreachableError):
            Session(own_address(), timeout_s=0.05)
        return len(os.listdir("/proc/self/fd"))

    before, *_, last = (attempt() for _ in range(5))
    assert last <= before


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
            sender.publish(channels.POSE, "h1", occluded_pose(2))
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
