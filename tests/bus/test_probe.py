"""Promises of the probe: the router process beats as long as messages of its own pass through its router."""

import mmap
import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from time import sleep

import pytest
import zenoh
from support.waiting import wait_for

from rcopterx.bus.endpoints import client_config, router_config
from rcopterx.bus.heartbeat import Heartbeat, HeartbeatPage, LoopPhase
from rcopterx.bus.router import probe_until

KEY = "rcopterx/lab/main/probe/router"
PERIOD_S = 0.005


@pytest.fixture
def router(tmp_path: Path) -> Iterator[tuple[zenoh.Session, HeartbeatPage]]:
    """A router, and what its probe shows the supervisor."""
    endpoint = f"unixsock-stream/{tmp_path / 'router.sock'}"
    page, (ended, end) = HeartbeatPage(), os.pipe()
    heartbeat = Heartbeat(mmap.mmap(page.descriptor, mmap.PAGESIZE))
    page.handed_over()
    with ExitStack() as stack:
        session = stack.enter_context(zenoh.open(router_config([endpoint], [], "probing")))
        config = client_config([endpoint], "probing", 10.0)
        probing = Thread(target=probe_until, args=(ended, config, KEY, PERIOD_S, heartbeat))
        probing.start()
        yield session, page
        os.write(end, b".")
        probing.join()
    assert page.phase is LoopPhase.ENDING


def test_it_beats_until_the_router_routes_no_more(router: tuple[zenoh.Session, HeartbeatPage]) -> None:
    session, page = router
    assert page.beats == 0
    wait_for(lambda: page.beats >= 3, "nothing comes back")
    session.close()

    def rests() -> bool:
        beats = page.beats
        sleep(20 * PERIOD_S)
        return page.beats == beats

    wait_for(rests, "messages come back from nowhere")
    assert rests()
