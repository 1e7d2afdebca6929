"""Supervisors of processes of a test."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from support.supervised import Fake, Supervise

from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor


@pytest.fixture
def supervise(tmp_path: Path) -> Iterator[Supervise]:
    with ExitStack() as stack:

        def build(*specs: Fake, **options: Any) -> Supervisor:
            forks = ForkServer(clock=options.get("clock", time.monotonic))
            supervisor = Supervisor(list(specs), tmp_path / "lab.toml", tmp_path, forks, **options)
            stack.callback(supervisor.stop_all)
            return supervisor

        yield build
