"""No loop that vehicles in the air wait for makes a call that can block, or leaves garbage, whatever happens.

Every process of the fleet is traced from its first heartbeat on: look-ups of names, files, subprocesses,
imports, and writes to standard output and error. See `support/tracer`.
"""

import json
import os
import socket
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import support
from integration_support import NAMES, Flying, fleet_text, free_port

from rcopterx.simulator.faults import BreakRadio, Occlude
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]
RECORDS = ("open", "os.stat", "os.mkdir", "os.remove", "os.listdir", "os.scandir")
CABLES = ("os.stat", "os.readlink", "os.mkdir", "os.remove", "os.symlink", "os.rename")
EXPECTED = {"simulator": CABLES, "recorder": RECORDS, "learner": (*RECORDS, "os.rename")}
"""Calls of the simulator, which stands for hardware: an emulated cable is a link in the file system. Calls of
the recorder and of the learner, whose loops write files: no vehicle waits for them."""


def vehicles() -> str:
    """A coaxial helicopter that leads a Crazyflie and a MAVLink quadrotor, which are named by a host name."""
    ports = [free_port(kind=socket.SOCK_DGRAM) for _ in range(2)]
    return f"""
[vehicles.h1]
subject = "heli1"
transmitter = {{ port = "radio-h1", model_match = 1 }}
[vehicles.h2]
type = "crazyflie"
subject = "heli2"
transmitter = {{ port = "udp://localhost:{ports[0]}" }}
follow = [{{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }}]
[vehicles.h3]
type = "mavlink_quadrotor"
subject = "heli3"
transmitter = {{ port = "udp://localhost:{ports[1]}" }}
follow = [{{ leader = "h1", offset_m = [-0.4, -0.5, 0.0] }}]
"""


def fly_through_everything(flying: Flying) -> None:
    """Pass every kind of message, request and failure that a flight can survive."""
    fleet = flying.fleet
    inject_faults(fleet.session, BreakRadio("h1", duration_s=0.5))
    fleet.wait_until(lambda: bool(fleet["h1"].state.problems()), 30, "the radio is not missed")
    fleet.wait_ready(timeout_s=60)
    fleet.take_off(NAMES, height_m=0.7, timeout_s=60)
    fleet.wait_for_formation()
    fleet["h1"].go_to((0.3, 0.2, 0.9), 0.4)
    fleet["h2"].tune(estimator="kalman")
    fleet["h1"].tune(controller="cascade", horizon=25)
    fleet.wait_for_arrival(["h1"])
    inject_faults(fleet.session, Occlude("heli2", duration_s=0.1))
    for process in ("agent-h2", "transmitters", "tracker"):
        replace(flying, process)
        fleet.wait_for_formation()
    fleet.promote("h2")
    fleet.wait_for_formation()
    fleet.land(NAMES, timeout_s=40)
    replace(flying, "router")
    fleet.wait_ready(timeout_s=60)


def replace(flying: Flying, process: str) -> None:
    """Kill a process, and wait until a spare has replaced it."""
    flying.wait_for_spare(process)
    supervisor, killed = flying.launcher_of(process).supervisor, flying.kill(process)
    flying.fleet.wait_until(
        lambda: supervisor.pid(process) not in (None, killed), 60, f"{process} is not replaced"
    )


def findings(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_no_loop_blocks_and_no_loop_leaves_garbage(
    launch: Launch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = tmp_path / "trace.jsonl"
    monkeypatch.setenv("RCOPTERX_TRACE", str(trace))
    monkeypatch.setenv("PYTHONPATH", str(Path(support.__file__).parent / "tracer"), os.pathsep)
    text = fleet_text(vehicles=vehicles(), simulator="speed = 0.5")
    flying = launch(f'{text}\n[log]\ndirectory = "{tmp_path / "flights"}"\n', record=True)
    fly_through_everything(flying)
    for launcher in flying.launchers.values():
        launcher.stop()
    found = findings(trace)
    traced = Counter(finding["process"][0] for finding in found if finding["event"] == "loop")
    assert set(traced) >= {"agent", "transmitters", "tracker", "router", "simulator", "recorder"}, traced
    collected = {finding["process"][0] for finding in found if finding["event"] == "garbage"}
    assert collected >= {"agent", "transmitters", "tracker", "simulator"}, "they switch the collection off"
    wrong = [
        finding
        for finding in found
        if finding["event"] != "loop"
        and (finding["event"] != "garbage" or finding["what"])
        and finding["event"] not in EXPECTED.get(finding["process"][0], ())
    ]
    assert not wrong, "\n".join(map(str, wrong))
