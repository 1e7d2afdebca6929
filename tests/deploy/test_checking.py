"""Promises of checking a fleet in a process of its own."""

import subprocess
import sys
from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.deploy import checking
from rcopterx.deploy.checking import check_apart
from rcopterx.deploy.fleet_file.reading import parse_fleet
from rcopterx.deploy.fleet_file.schema import FleetError


def test_a_good_fleet_passes_and_a_wrong_field_is_named(tmp_path: Path) -> None:
    check_apart(parse_fleet(PAIR), tmp_path)
    wrong = parse_fleet(PAIR + 'control = { controller = "x" }')
    with pytest.raises(FleetError, match=r"^vehicles\.h2\.control: no controller is called 'x'"):
        check_apart(wrong, tmp_path)


def test_a_check_that_fails_for_another_reason_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checking.sys, "executable", "/bin/false")
    with pytest.raises(OSError, match="the fleet cannot be checked, exit code 1"):
        check_apart(parse_fleet(PAIR), tmp_path)


def test_who_launches_needs_none_of_the_libraries_of_agents() -> None:
    script = "import sys, rcopterx.deploy.launcher; print(*{'numba', 'scipy', 'osqp'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
