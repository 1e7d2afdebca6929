"""Promises of the logs of several hosts: all that answer are merged, those that do not are named."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from support.fleets import PAIR

from rcopterx.bus.requests import ReadLogs, ReadLogsReply
from rcopterx.bus.session import NotServedError
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.processes.log_reading import read_page
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.terminal.fleet_logs import FleetLogs

HOSTS = "".join(
    f'[hosts.{host}]\naddress = "127.0.0.{number}"\n' for number, host in enumerate(("main", "far", "off"), 1)
)


class Joined:
    """A fleet of which one other host answers."""

    def __init__(self, host: str, directory: Path) -> None:
        self._host, self._directory = host, directory
        self.session = SimpleNamespace(request=self._request)

    def _request(self, unit: str, request: ReadLogs, *_: float) -> ReadLogsReply:
        if unit != self._host:
            raise NotServedError(unit)
        return read_page(self._directory, request)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FleetFile:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "run"))
    (tmp_path / "lab.toml").write_text(PAIR + HOSTS)
    return load_fleet(tmp_path / "lab.toml")


def test_logs_of_all_hosts_come_together(lab: FleetFile, tmp_path: Path) -> None:
    far = tmp_path / "far"
    far.mkdir()
    (far / "router.log").write_text("2026-11-22T03:00:01.000Z INFO started\n  details\n")
    (run_directory("lab", None) / "log" / "tracker.log").write_text("2026-11-22T03:00:02.000Z INFO ready\n")
    logs = FleetLogs(lab, (), Joined("far", far))  # type: ignore[arg-type]
    assert logs.missing == ["main", "off"]
    assert {"router", "tracker", "launcher"} <= set(logs.processes)
    found = [(host, line.process, line.text) for host, line in logs.new_lines()]
    assert found == [
        ("far", "router", "INFO started"),
        ("far", "router", "  details"),
        ("here", "tracker", "INFO ready"),
    ]
    with (far / "router.log").open("a") as log:
        log.write("more of it\n")
    ((host, line),) = logs.new_lines()
    assert (host, line.time, line.text) == ("far", "2026-11-22T03:00:01.000Z", "more of it")


def test_without_a_fleet_that_is_up_the_logs_of_this_computer_are_read(lab: FleetFile) -> None:
    (run_directory("lab", None) / "log" / "tracker.log").write_text("2026-11-22T03:00:02.000Z INFO ready\n")
    logs = FleetLogs(lab, ("tracker",), None)
    assert logs.missing == ["main", "far", "off"]
    assert [line.text for _, line in logs.new_lines()] == ["INFO ready"]
