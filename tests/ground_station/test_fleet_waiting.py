"""Promises of waiting: no notification is missed, deadlines hold, a stop ends every wait of the block."""

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from support.waiting import DEADLINE_S

from rcopterx.bus.clock import LOCKSTEP
from rcopterx.bus.lockstep.page import create_page
from rcopterx.bus.processes import SCRIPT, SIMULATOR
from rcopterx.bus.session import BusAddress, Session
from rcopterx.ground_station.scripting.waiting import (
    Notifier,
    NotReachedError,
    StoppedError,
    begin_turns,
    stopped_by,
)


def test_what_holds_already_is_not_waited_for() -> None:
    assert Notifier().wait_until(lambda: True, 0.0)


def test_what_never_holds_ends_at_the_deadline() -> None:
    assert not Notifier().wait_until(lambda: False, 0.02)


def test_one_ring_wakes_every_thread_that_waits() -> None:
    notifier, there = Notifier(), threading.Event()
    looked = threading.Barrier(4)

    def wait() -> bool:
        first = True

        def look() -> bool:
            nonlocal first
            if first:
                first = False
                looked.wait(60)
                return False
            return there.is_set()

        return notifier.wait_until(look, 60)

    with ThreadPoolExecutor(3) as pool:
        waiting = [pool.submit(wait) for _ in range(3)]
        looked.wait(60)
        there.set()
        notifier.notify()
        assert all(future.result(60) for future in waiting)


def test_a_stop_ends_the_waits_of_the_block_and_only_those() -> None:
    notifier, stop = Notifier(), threading.Event()
    with stopped_by(stop):
        assert not notifier.wait_until(lambda: False, 0.01)
        stop.set()
        with pytest.raises(StoppedError):
            notifier.wait_until(lambda: False, 60)
        assert notifier.wait_until(lambda: True, 10), "what holds is told all the same"
    assert not notifier.wait_until(lambda: False, 0.01)


def test_a_stop_does_not_reach_other_threads() -> None:
    notifier, stop = Notifier(), threading.Event()
    stop.set()
    with stopped_by(stop), ThreadPoolExecutor(1) as pool:
        assert pool.submit(notifier.wait_until, lambda: False, 0.01).result(60) is False


def test_a_fleet_in_lockstep_that_does_not_start_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bus_address: BusAddress
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.waiting.LOCKSTEP_START_S", 0.1)
    create_page(tmp_path / "lockstep", [SIMULATOR, "agent-h2", SCRIPT])
    clock = replace(LOCKSTEP, page=tmp_path / "lockstep")
    address = replace(bus_address, clock=clock, process=SCRIPT)
    with (
        Session(address, timeout_s=DEADLINE_S, begin=False) as session,
        pytest.raises(NotReachedError, match=f"did not start: missing after 0.1 s: {SIMULATOR}, agent-h2"),
    ):
        begin_turns(session)
