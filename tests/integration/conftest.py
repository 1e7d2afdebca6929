"""Real fleets for integration tests: own ports, own namespace, own run directory, and clean-up."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from integration_support import Flying, fleet_text, fleets, in_lockstep
from one_process import fly_in_one_process

LOCKSTEP_LIMIT_S = 600
"""Only bounds how long a test takes to fail: in lockstep a fleet is as slow as the machine is busy."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let tests in lockstep take longer than others."""
    for item in items:
        own = item.get_closest_marker("timeout")
        if in_lockstep(item) and (own is None or own.args[0] < LOCKSTEP_LIMIT_S):
            item.add_marker(pytest.mark.timeout(LOCKSTEP_LIMIT_S))


@pytest.fixture
def launch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Iterator[Callable[..., Flying]]:
    """Start a fleet; it is cut and stopped after the test."""
    with fleets(tmp_path, monkeypatch, lockstep=in_lockstep(request.node)) as start:
        yield start


@pytest.fixture(scope="module")
def launch_once(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[Callable[..., Flying]]:
    """Start a fleet that all tests of a file fly with; it is cut and stopped after the last one."""
    directory, lockstep = tmp_path_factory.mktemp("fleet"), in_lockstep(request.node)
    with pytest.MonkeyPatch.context() as patch, fleets(directory, patch, lockstep=lockstep) as start:
        yield start


@pytest.fixture
def fly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Callable[..., None]:
    """Fly a fleet in lockstep in this process, with `--real-time` in processes of its own."""

    def flown(flight: Callable[[Flying], None], text: str | None = None, **options: str) -> None:
        if text is None:
            text = fleet_text(**options)
        if in_lockstep(request.node):
            fly_in_one_process(text, flight)
            return
        with fleets(tmp_path, monkeypatch) as start:
            flight(start(text))

    return flown
