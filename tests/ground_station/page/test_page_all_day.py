"""Promises of a page that stays open all day: it follows its fleet down and up again."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from support.bus import free_port
from support.scripted import ScriptedVehicle, patient_fleet
from support.waiting import wait_for

from rcopterx.bus.session import BusUnreachableError
from rcopterx.ground_station.page.feed import Seen
from rcopterx.ground_station.page.page import PageFrame, keep_showing
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.joining import WrongFleetError

KEY = "key-of-this-test"


@pytest.fixture
def frame() -> Iterator[PageFrame]:
    frame = PageFrame(free_port(), "trio", KEY)
    yield frame
    frame.server.stop()


@contextmanager
def shown(frame: PageFrame, join: Callable[[], Fleet]) -> Iterator[None]:
    stop = threading.Event()
    showing = threading.Thread(target=keep_showing, args=(frame, join, stop, 0.0))
    showing.start()
    try:
        yield
    finally:
        stop.set()
        showing.join()


def received(frame: PageFrame) -> dict[str, Any]:
    message: dict[str, Any] = json.loads(frame.feed.after(Seen()) or b"{}")
    return message


def shows(frame: PageFrame, sentence: str) -> Callable[[], bool]:
    """Whether a browser receives this sentence."""
    return lambda: bool(received(frame)["texts"]["sentence"]["text"] == sentence)


def test_a_page_waits_for_its_fleet_joins_it_and_joins_again_when_it_has_been_down(
    frame: PageFrame, fleet: Fleet, vehicles: dict[str, ScriptedVehicle]
) -> None:
    up = threading.Event()
    joined: list[Fleet] = []

    def join() -> Fleet:
        if not up.wait(0.05):
            raise BusUnreachableError("no router")
        joined.append(patient_fleet(fleet.file))
        return joined[-1]

    with shown(frame, join):
        wait_for(shows(frame, "trio is down; start it with rcopterx up trio"), "waits")
        assert frame.server.perform is None
        up.set()
        wait_for(shows(frame, "ready to take off"), "not joined")
        assert frame.server.perform is not None
        for vehicle in vehicles.values():
            vehicle.speaks = False
        wait_for(lambda: len(joined) == 2, "not joined again")
        for vehicle in vehicles.values():
            vehicle.speaks = True
        wait_for(shows(frame, "ready to take off"), "not shown again")
        assert set(received(frame)["texts"]["rows"]) == {"h1", "h2"}


def test_a_page_says_why_it_cannot_join_a_fleet(frame: PageFrame) -> None:
    def join() -> Fleet:
        raise WrongFleetError("another version of the file is up")

    with shown(frame, join):
        wait_for(shows(frame, "another version of the file is up"), "not shown")
        assert received(frame)["texts"]["down"]
