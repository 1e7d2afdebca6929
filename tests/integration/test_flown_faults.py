"""Faults of the table, flown by the command on fleets of real processes: every promise is kept."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from integration_support import NAMES, fleet_text, of_types
from support.radio_addresses import radio_paths

from rcopterx_studies.faults.table import FAULT_FLIGHTS

pytestmark = pytest.mark.integration

DEPENDS_ON_THE_MACHINE = "ms without a fresh command"
QUICK = ("vicon-gateway-stopped-30-s", "router-spins", "pose-jumps-100-ms")
"""Of other kinds than those that fly in shared_fleet."""
OF_CRAZYFLIES = tuple(
    name
    for name in FAULT_FLIGHTS
    if name.startswith(("leader-", "follower-", "transmitter-gateway-", "radio-")) and name != "radio-no-dsm2"
)
"""What is between poses and firmware; a Crazyradio has no other protocol."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(fleet_text(simulator='conditions = "helicopter"'))
    return path


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[dict[str, str]]:
    # A short path, because the router's socket lives in it.
    with TemporaryDirectory(prefix="rcopterx-") as run:
        yield os.environ | {"RCOPTERX_RUN": run, "RCOPTERX_FLIGHTS": str(tmp_path / "flights")}


def run_up(path: Path, environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rcopterx", *arguments, "--up", "--fleet", str(path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert "Traceback" not in done.stderr, done.stderr
    return done


def assert_promises_kept(names: tuple[str, ...], out: Path, done: subprocess.CompletedProcess[str]) -> None:
    reports = json.loads((out / "faults.json").read_text())
    assert {report["name"] for report in reports} == set(names), done.stderr
    broken = {
        report["name"]: report["problem"] or failed
        for report in reports
        if (failed := [
            (check["name"], check["figure"])
            for check in report["checks"]
            if not check["passed"] and DEPENDS_ON_THE_MACHINE not in check["name"]
        ]) or report["problem"]
    }  # fmt: skip
    assert not broken
    assert "<h1>Flown faults" in (out / "index.html").read_text()


@pytest.mark.timeout(240)
def test_everybody_flies_on_whichever_of_these_goes_wrong(
    path: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    done = run_up(path, environment, "faults", *QUICK, "--no-record", "--report", str(tmp_path / "out"))
    assert_promises_kept(QUICK, tmp_path / "out", done)


@pytest.mark.lockstep
@pytest.mark.timeout(180)
def test_in_lockstep_faults_of_the_laboratory_are_flown_and_others_are_not_with_the_reason(
    path: Path, environment: dict[str, str]
) -> None:
    path.write_text(of_types(dict.fromkeys(NAMES, "crazyflie"), radio_paths(3)))
    names = ("leader-killed", "radio-no-dsm2", "pose-jumps-100-ms")
    done = run_up(path, environment, "faults", *names, "--lockstep", "--no-record", "--json")
    reports = {report["name"]: (report["verdict"], report["problem"]) for report in json.loads(done.stdout)}
    assert done.returncode == 0, done.stderr
    assert reports == {
        "leader-killed": ("not flown", "it breaks processes, for which lockstep waits"),
        "radio-no-dsm2": (
            "not flown",
            "break_radio: h2: only a Multiprotocol module reports that it does not know the protocol",
        ),
        "pose-jumps-100-ms": ("passed", None),
    }


@pytest.mark.campaign
@pytest.mark.timeout(5400)
def test_every_promise_of_the_table_is_kept(path: Path, tmp_path: Path, environment: dict[str, str]) -> None:
    done = run_up(path, environment, "faults", "--report", str(tmp_path / "out"))
    of_helicopters = tuple(name for name in FAULT_FLIGHTS if not name.startswith("vehicle-attitude-"))
    assert_promises_kept(of_helicopters, tmp_path / "out", done)


@pytest.mark.campaign
@pytest.mark.timeout(1800)
def test_crazyflies_keep_the_promises_about_agents_transmitter_gateway_and_radios(
    path: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    path.write_text(of_types(dict.fromkeys(NAMES, "crazyflie"), radio_paths(3)))
    done = run_up(path, environment, "faults", *OF_CRAZYFLIES, "--report", str(tmp_path / "out"))
    assert_promises_kept(OF_CRAZYFLIES, tmp_path / "out", done)
