"""Real fleets for integration tests: own ports, own namespace, own run directory, and clean-up."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from integration_support import Flying, fleets


@pytest.fixture
def launch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Flying]]:
    """Start a fleet; it is cut and stopped after the test."""
    with fleets(tmp_path, monkeypatch) as start:
        yield start


@pytest.fixture(scope="module")
def launch_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Flying]]:
    """Start a fleet that all tests of a file fly with; it is cut and stopped after the last one."""
    with pytest.MonkeyPatch.context() as patch, fleets(tmp_path_factory.mktemp("fleet"), patch) as start:
        yield start
