"""Promises of checking a fleet in a process of its own."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.deploy import checking
from rcopterx.deploy.checking import check_apart
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError


@pytest.fixture
def forks() -> Iterator[ForkServer]:
    with closing(ForkServer(["rcopterx.deploy.roles.agent", "rcopterx.deploy.roles.simulator"])) as server:
        yield server


def test_a_good_fleet_passes_and_a_wrong_field_is_named(tmp_path: Path, forks: ForkServer) -> None:
    check_apart(parse_fleet(PAIR), tmp_path, forks)
    wrong = parse_fleet(PAIR + 'control = { controller = "x" }')
    with pytest.raises(FleetError, match=r"^vehicles\.h2\.control: no controller is called 'x'"):
        check_apart(wrong, tmp_path, forks)
    # Nothing stays behind.
    assert list(tmp_path.iterdir()) == []


def test_a_check_that_fails_for_another_reason_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forks: ForkServer
) -> None:
    monkeypatch.setattr(checking, "MODULE", "no_such_module")
    with pytest.raises(OSError, match=r"(?s)the fleet cannot be checked, exit code 1: .*no_such_module"):
        check_apart(parse_fleet(PAIR), tmp_path, forks)


def test_who_launches_needs_none_of_the_libraries_of_agents() -> None:
    script = (
        "import sys, rcopterx.deploy.hosts.launcher; print(*{'numba', 'scipy', 'osqp'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
