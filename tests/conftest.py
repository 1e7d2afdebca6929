"""Fixtures that tests of several packages share."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from support.bus import patient_links, router
from support.waiting import DEADLINE_S

from rcopterx.bus.session import BusAddress, Session

# A busy machine is no fault of what is tested, and every change is judged by the same examples.
# `make campaign` looks for new ones with --hypothesis-profile=search.
COMMON: dict[str, Any] = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("repeatable", derandomize=True, max_examples=60, **COMMON)
settings.register_profile("search", max_examples=300, **COMMON)
settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this project."""
    parser.addoption(
        "--real-time", action="store_true", help="fly in real time what otherwise flies in lockstep"
    )


@pytest.fixture
def bus_address() -> Iterator[BusAddress]:
    """Address of a running router that only this test uses."""
    with patient_links(), router() as address:
        yield address


@pytest.fixture
def join(bus_address: BusAddress) -> Iterator[Callable[..., Session]]:
    """Open sessions on the test's bus; they are closed after the test, the last one first."""
    with ExitStack() as stack:

        def opened(**options: Any) -> Session:
            return stack.enter_context(Session(bus_address, **{"timeout_s": DEADLINE_S} | options))

        yield opened


@pytest.fixture(autouse=True, scope="session")
def _own_flight_logs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test writes flight logs among those of the user."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RCOPTERX_FLIGHTS", str(tmp_path_factory.mktemp("flights")))
        yield


@pytest.fixture(autouse=True)
def _ordinary_scheduling() -> Iterator[None]:
    """No test leaves its own process in the real-time class, to disturb whatever flies beside it."""
    before = os.sched_getscheduler(0)
    yield
    assert os.sched_getscheduler(0) == before


@pytest.fixture(autouse=True)
def _ordinary_signals() -> Iterator[None]:
    """Signals end this process as before, also after a test of a process that catches them."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
