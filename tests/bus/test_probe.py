"""Promises of the probe: messages of the router process to itself come back as long as the router routes."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh
from support.waiting import wait_for

from rcopterx.bus.endpoints import client_config, router_config
from rcopterx.bus.router import Probe

KEY = "rcopterx/lab/main/probe/router"


@pytest.fixture
def router(tmp_path: Path) -> Iterator[tuple[zenoh.Session, Probe]]:
    endpoint = f"unixsock-stream/{tmp_path / 'router.sock'}"
    with ExitStack() as stack:
        session = stack.enter_context(zenoh.open(router_config([endpoint], [], "probing")))
        sender, receiver = (
            stack.enter_context(zenoh.open(client_config([endpoint], "probing", 10.0))) for _ in range(2)
        )
        yield session, Probe(sender, receiver, KEY)


def sent_and_came_back(probe: Probe) -> bool:
    probe.send()
    return probe.came_back()


def test_messages_come_back_until_the_router_routes_no_more(router: tuple[zenoh.Session, Probe]) -> None:
    session, probe = router
    assert not probe.came_back()
    wait_for(lambda: sent_and_came_back(probe), "nothing comes back")
    session.close()
    wait_for(lambda: not sent_and_came_back(probe), "messages come back from nowhere")
    for _ in range(10):
        assert not sent_and_came_back(probe)
