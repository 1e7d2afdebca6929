"""Real fleets for integration tests: own ports, own namespace, own run directory, and clean-up."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from integration_support import Flying, fleet_text, free_port

from deploy.fleet_file.reading import load_fleet
from deploy.launcher import Launcher
from ground_station.fleet import Fleet


@contextmanager
def fleets(directory: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Flying]]:
    """Start fleets; they are landed and stopped at the end."""
    with ExitStack() as stack:
        # A short path, because the router's socket lives in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", run)

        def start(text: str | None = None, *, without: tuple[str, ...] = (), **options: str) -> Flying:
            if text is None:
                text = fleet_text(free_port(), {"main": ("127.0.0.1", free_port())}, **options)
            path = directory / "lab.toml"
            path.write_text(text)
            file = load_fleet(path)
            launchers = {host: stack.enter_context(Launcher(file, host, without)) for host in file.hosts}
            fleet = Fleet(file, timeout_s=10)
            stack.callback(fleet.close)
            fleet.wait_ready(timeout_s=30)
            return Flying(path, fleet, launchers)

        yield start


@pytest.fixture
def launch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Flying]]:
    """Start a fleet; it is landed and stopped after the test."""
    with fleets(tmp_path, monkeypatch) as start:
        yield start


@pytest.fixture(scope="module")
def launch_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Flying]]:
    """Start a fleet that all tests of a file fly with; it is landed and stopped after the last one."""
    with pytest.MonkeyPatch.context() as patch, fleets(tmp_path_factory.mktemp("fleet"), patch) as start:
        yield start
