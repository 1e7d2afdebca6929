"""A program that knows nothing of our packages flies a vehicle, falls silent, and the vehicle flies on."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from integration_support import Flying, Truth, at, fallbacks

from rcopterx.bus import channels
from rcopterx.ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

EXAMPLE = Path(__file__).parents[3] / "examples" / "external_control"

PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from external_control import ExternalControl
from fly import feedback
vehicle = ExternalControl("lab", "h1", "student", {router!r}, {namespace!r})
vehicle.take(0.3)
print("taken", flush=True)
while True:
    task = vehicle.next_task()
    vehicle.answer(task, [feedback(task)])
"""


def program(flying: Flying) -> str:
    host = flying.fleet.file.hosts["main"]
    router = f"tcp/{host.address}:{host.router_port}"
    return PROGRAM.format(folder=str(EXAMPLE), router=router, namespace=flying.fleet.file.bus.namespace)


def test_a_program_outside_flies_a_vehicle_until_it_falls_silent(flying: Flying, truth: Truth) -> None:
    fleet, place_m = flying.fleet, (0.2, 0.1, 0.9)
    silences = fallbacks(flying, "h1", "external_silent")
    answers = fleet.session.subscribe(channels.EXTERNAL_INPUT, "h1", depth=512)
    client = subprocess.Popen([sys.executable, "-c", program(flying)], stdout=subprocess.PIPE, text=True)
    try:
        assert client.stdout is not None
        assert client.stdout.readline() == "taken\n"

        numbers: list[int] = []

        def flown_from_outside() -> bool:
            numbers.extend(received.message.number for received in answers.drain())
            return client_of(flying) == "student" and len(numbers) > 5

        fleet.wait_until(flown_from_outside, 10, "nobody flies h1 from outside")
        with pytest.raises(RefusedError, match="student flies it from outside"):
            fleet["h1"].tune(horizon=20)
        fleet["h1"].go_to(place_m)
        fleet.wait_until(
            lambda: at(truth, "h1", place_m, 0.15), 15, "the program does not fly h1 to its set point"
        )
        assert client_of(flying) == "student"
        truth.assert_nobody_touched_down()
    finally:
        client.kill()
        client.wait()
    fleet.wait_until(
        lambda: client_of(flying) == "" and fallbacks(flying, "h1", "external_silent") > silences,
        10,
        "h1 does not fly by itself again",
    )
    fleet.wait_until(lambda: at(truth, "h1", place_m, 0.15), 10, "h1 has left its place")
    truth.assert_nobody_touched_down()


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
    fields = set(re.findall(r'task\{"(\w+)"\}', script))
    assert fields
    assert fields <= set(channels.CONTROL_TASK.message.__struct_fields__)
    assert "py.external_control.ExternalControl(fleet, vehicle" in script
