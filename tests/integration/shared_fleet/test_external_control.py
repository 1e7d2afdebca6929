"""A program that knows nothing of our packages flies a vehicle, falls silent, and the vehicle flies on."""

import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from integration_support import Flying, Truth, at, fallbacks, free_port
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

EXAMPLE = Path(__file__).parents[3] / "examples" / "external_control"

PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from external_control import ExternalControl
from fly import feedback
vehicle = ExternalControl("lab", "h1", "student", {router!r}, {namespace!r})
vehicle.take(0.3)
while True:
    task = vehicle.next_task()
    vehicle.answer(task, [feedback(task)])
"""


def router_of(flying: Flying) -> str:
    host = flying.fleet.file.hosts["main"]
    return f"tcp/{host.address}:{host.router_port}"


def python_program(flying: Flying) -> str:
    """A program in Python, which flies through Zenoh."""
    namespace = flying.fleet.file.bus.namespace
    return PROGRAM.format(folder=str(EXAMPLE), router=router_of(flying), namespace=namespace)


@contextmanager
def http_bridge(flying: Flying, port: int) -> Iterator[None]:
    """The bridge for languages without Zenoh, as a process of its own."""
    options = {"router": router_of(flying), "namespace": flying.fleet.file.bus.namespace}
    code = f"from http_bridge import main; main('lab', 'h1', {port}, **{options})"
    with subprocess.Popen([sys.executable, "-c", code], cwd=EXAMPLE) as bridge:
        try:
            wait_for(lambda: listens(port), "the bridge does not listen", 20)
            yield
        finally:
            bridge.kill()


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def flies_until_silent(flying: Flying, truth: Truth, command: list[str], name: str) -> None:
    """A program that calls itself so flies h1 to a new place; killed, it leaves a vehicle that flies on."""
    fleet, place_m = flying.fleet, (0.2, 0.1, 0.9)
    silences = fallbacks(flying, "h1", "external_silent")
    answers = fleet.session.subscribe(channels.EXTERNAL_INPUT, "h1", depth=512)
    numbers: list[int] = []

    def flown_from_outside() -> bool:
        numbers.extend(received.message.number for received in answers.drain())
        return client_of(flying) == name and len(numbers) > 5

    with subprocess.Popen(command, cwd=EXAMPLE) as client:
        try:
            fleet.wait_until(flown_from_outside, 30, "nobody flies h1 from outside")
            with pytest.raises(RefusedError, match=f"{name} flies it from outside"):
                fleet["h1"].tune(horizon=20)
            fleet["h1"].go_to(place_m)
            fleet.wait_until(
                lambda: at(truth, "h1", place_m, 0.15), 30, "the program does not fly h1 to its set point"
            )
            assert client_of(flying) == name
            truth.assert_none_touched_down()
        finally:
            client.kill()
    fleet.wait_until(
        lambda: client_of(flying) == "" and fallbacks(flying, "h1", "external_silent") > silences,
        30,
        "h1 does not fly by itself again",
    )
    fleet.wait_until(lambda: at(truth, "h1", place_m, 0.15), 30, "h1 has left its place")
    truth.assert_none_touched_down()


def test_a_program_outside_flies_a_vehicle_until_it_falls_silent(flying: Flying, truth: Truth) -> None:
    flies_until_silent(flying, truth, [sys.executable, "-c", python_program(flying)], "student")


@pytest.mark.campaign
@pytest.mark.skipif(
    shutil.which("octave-cli") is None, reason="no Octave on this computer: apt-get install octave"
)
def test_octave_flies_a_vehicle_until_it_falls_silent(flying: Flying, truth: Truth) -> None:
    port = free_port()
    with http_bridge(flying, port):
        command = ["octave-cli", "--quiet", "--norc", "--eval", f"fly_http(60, {port})"]
        flies_until_silent(flying, truth, command, "http_client")


def client_of(flying: Flying) -> str | None:
    """Program outside that flies h1, empty if none does."""
    status = flying.fleet.state_of("h1").agent
    return None if status is None else status.diagnostics.client


def test_the_matlab_script_calls_what_the_python_module_has() -> None:
    """MATLAB reaches the module through its Python interface; its calls are those that Python makes here."""
    script = (EXAMPLE / "fly.m").read_text(encoding="utf-8")
    module = (EXAMPLE / "external_control.py").read_text(encoding="utf-8")
    calls = set(re.findall(r"controlled\.(\w+)\(", script))
    assert calls == {"take", "next_task", "answer", "release", "close"}
    for call in calls:
        assert f"def {call}(self" in module
    (names,) = re.findall(r"for name = \[(.+)\]", script)
    fields = {"reference", *re.findall(r'"(\w+)"', names)}
    assert set(re.findall(r"task\.(\w+)", (EXAMPLE / "state_feedback.m").read_text("utf-8"))) == fields
    assert fields <= set(channels.CONTROL_TASK.message.__struct_fields__)
    assert "py.external_control.ExternalControl(fleet, vehicle" in script
