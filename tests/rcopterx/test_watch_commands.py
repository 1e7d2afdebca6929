"""Promises of the watching commands: exit codes and JSON for scripts, a picture for people."""

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from support.bus import free_port, own_address
from support.patient_command import patient_command
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet
from support.waiting import DEADLINE_S, wait_for
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.commands.ground import page_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet

Vehicles = dict[str, ScriptedVehicle]


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "250", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.mark.parametrize("command", ["status", "check", "top"])
def test_without_a_fleet_the_error_says_how_to_start_one(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "rcopterx.ground_station.scripting.fleet.Fleet",
        lambda file, host, _: Fleet(file, host, timeout_s=0.05),
    )
    path = tmp_path / "down.toml"
    path.write_text(fleet_file_text(own_address()))
    result = run(command, "-f", str(path))
    assert result.exit_code == 1
    assert result.stderr.startswith("error: no router at")
    assert f"is the fleet up? (rcopterx up {path})" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_status_tells_every_vehicle_in_words_and_in_json(up: str) -> None:
    assert "h2: ground, transmitter disarmed" in run("status", "-f", up).output
    status = json.loads(run("status", "--json", "-f", up).output)
    assert status["ready"]
    assert set(status["vehicles"]) == {"h1", "h2"}


def test_check_is_for_scripts_0_when_ready_and_1_with_what_is_missing(up: str, vehicles: Vehicles) -> None:
    result = run("check", "-f", up)
    assert (result.exit_code, result.output.strip()) == (0, "lab: ready")
    vehicles["h2"].pose_age_s = 3.2
    assert run("check", "h1", "-f", up).exit_code == 0
    result = run("check", "--wait", "0.2", "-f", up)
    assert result.exit_code == 1
    assert "h2: no pose for 3.2 s" in result.output
    result = run("check", "--json", "--wait", "0", "-f", up)
    assert result.exit_code == 1
    assert json.loads(result.output)["ready"] is False
    assert run("check", "h9", "-f", up).exit_code == 2


def test_check_that_waits_also_waits_for_the_router(
    up: str, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    patience: list[float] = []

    def joined(file: FleetFile, host: str | None, router_within_s: float) -> Fleet:
        patience.append(router_within_s)
        return patient_fleet(file, host)

    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.Fleet", joined)
    for wait in ("1.5", "20"):
        assert run("check", "--wait", wait, "-f", up).exit_code == 0
    assert patience == [3.0, 20.0]


def test_without_a_terminal_top_shows_the_fleet_once(up: str, vehicles: Vehicles) -> None:
    vehicles["h2"].ready = False
    result = run("top", "-f", up)
    assert result.exit_code == 0
    assert "h1" in result.output
    assert "h2: transmitter not ready: module speaks" in result.output


def test_top_shows_the_fleet_in_a_terminal_until_ctrl_c(up: str) -> None:
    outside, inside = pty.openpty()
    process = subprocess.Popen(
        patient_command("top", "-f", up),
        stdin=inside, stdout=inside, stderr=inside, env=os.environ | {"COLUMNS": "80", "TERM": "xterm"},
    )  # fmt: skip
    try:
        wait_for_picture(outside, b"missed")
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE_S) == 0
    finally:
        process.kill()
        process.wait()
        os.close(outside)
        os.close(inside)


def wait_for_picture(terminal: int, words: bytes) -> None:
    """Read what a terminal shows until it holds these words."""
    shown = b""
    deadline_s = time.monotonic() + DEADLINE_S
    while words not in shown:
        assert time.monotonic() < deadline_s, shown
        if select.select([terminal], [], [], 0.1)[0]:
            shown += os.read(terminal, 65536)


def test_a_wide_top_shows_all_columns(up: str) -> None:
    assert "latency radio" not in run("top", "-f", up).output
    shown = run("top", "--wide", "-f", up).output
    assert all(
        words in shown for words in ("rejections", "position", "radio", "latency total", "latency radio")
    )


def test_the_web_page_says_what_it_needs(up: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.commands.ground.find_spec", lambda name: None)
    result = run("ground", "-f", up)
    assert result.exit_code == 1
    assert "pip install 'rcopterx[ground]'" in result.stderr


def test_the_web_page_is_served_until_ctrl_c(up: str) -> None:
    port = free_port()
    process = subprocess.Popen(
        patient_command("ground", "-f", up, "--port", str(port)),
        stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        address = next(line.split()[0] for line in process.stdout if line.startswith("http"))
        assert address.startswith(f"http://127.0.0.1:{port}/")
        with urllib.request.urlopen(address, timeout=DEADLINE_S) as answer:
            assert b"<html" in answer.read().lower()
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=DEADLINE_S)
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE_S) == 0
    finally:
        process.kill()
        process.wait()


def test_the_web_page_is_served_before_its_fleet_is_up(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(fleet_file_text(own_address()))
    process = subprocess.Popen(
        patient_command("ground", "-f", str(path), "--port", str(free_port())),
        stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        address = next(line.split()[0] for line in process.stdout if line.startswith("http"))
        with urllib.request.urlopen(address, timeout=DEADLINE_S) as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE_S) == 0
    finally:
        process.kill()
        process.wait()


def test_the_page_beside_a_demonstration_tells_its_address_and_ends_with_it(up: str) -> None:
    announced: list[str] = []
    with page_of(up, announced.append):
        wait_for(lambda: bool(announced), "no address")
        (line,) = announced
        assert line.startswith("web page: http://127.0.0.1:")
        with urllib.request.urlopen(line.removeprefix("web page: "), timeout=DEADLINE_S) as answer:
            assert answer.status == 200
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(line.removeprefix("web page: "), timeout=DEADLINE_S)


def test_a_page_that_breaks_off_is_announced_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    open_process = subprocess.Popen

    def broken(_: list[str], **options: Any) -> subprocess.Popen[str]:
        return open_process([sys.executable, "-c", "raise RuntimeError('no floor')"], **options)

    monkeypatch.setattr("rcopterx.commands.ground.subprocess.Popen", broken)
    announced: list[str] = []
    with page_of("trio", announced.append):
        wait_for(lambda: announced == ["the web page has ended: RuntimeError: no floor"], "not announced")


def test_a_demonstration_without_websockets_says_what_the_page_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.commands.ground.find_spec", lambda name: None)
    announced: list[str] = []
    with page_of("trio", announced.append):
        assert announced == ["no web page: it needs websockets: pip install 'rcopterx[ground]'"]
