"""Promises of the bus in memory: it does for sessions what Zenoh does."""

from collections.abc import Iterator
from unittest.mock import patch

import pytest

from rcopterx.bus import channels, session
from rcopterx.bus.requests import Arm
from rcopterx.bus.session import BusAddress, NotServedError, RawMessage, RequestFailedError, Session
from rcopterx_studies.search.memory_bus import MemoryBus

ADDRESS = BusAddress((), "lab")


@pytest.fixture(autouse=True)
def in_memory() -> Iterator[None]:
    with patch.object(session, "opened", MemoryBus().open):
        yield


def test_taps_get_messages_of_other_sessions_until_they_close() -> None:
    tapped: list[RawMessage] = []
    listening = Session(ADDRESS)
    listening.tap(tapped.append)
    with Session(ADDRESS) as sending:
        sending.republish("fleet", channels.KILL.topic, b"1")
        listening.close()
        sending.republish("fleet", channels.KILL.topic, b"2")
    found = [(message.unit, message.topic, message.payload) for message in tapped]
    assert found == [("fleet", channels.KILL.topic, b"1")]


def test_requests_without_a_server_are_not_served() -> None:
    with Session(ADDRESS) as asking, pytest.raises(NotServedError):
        asking.request("h1", Arm(), patience_s=0.0)


def test_malformed_requests_are_refused_with_the_reason() -> None:
    with Session(ADDRESS) as asking, Session(ADDRESS) as serving:
        serving.serve("h1", ["arm"])
        with patch.object(session, "encode", lambda _: b"no"), pytest.raises(RequestFailedError, match="arm"):
            asking.request("h1", Arm(), patience_s=0.0)
