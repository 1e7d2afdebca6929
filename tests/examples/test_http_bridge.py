"""Promises of control by plain HTTP: what the bridge says and takes; programs in C++ and Octave fly by it."""

import http.client
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "external_control"
sys.path.insert(0, str(EXAMPLE))
import fly  # noqa: E402
import http_bridge  # noqa: E402

sys.path.remove(str(EXAMPLE))

PERIOD_S = 0.02


class DoubleIntegrator:
    """A vehicle without lag that is flown from outside; its task comes at once."""

    def __init__(self) -> None:
        self.motion = np.array([1.0, -0.5, 0.3, 0.4, 0.0, 0.0, 0.0, 0.0])
        self.taken = False
        self.patience_s = 0.0
        self.refusal: str | None = None
        self.tasks: list[dict[str, Any]] = []
        self.answers: list[list[float]] = []
        self.number = 0

    def take(self, patience_s: float) -> None:
        if self.refusal is not None:
            raise RuntimeError(self.refusal)
        self.taken, self.patience_s = True, patience_s

    def release(self) -> None:
        self.taken = False

    def next_task(self) -> dict[str, Any]:
        if not self.taken:
            raise TimeoutError("no task for 1.0 s")
        self.number += 1
        task = {
            "number": self.number,
            "motion": list(self.motion),
            "reference": [[0.0, 0.0, 1.0, 0.0, *[0.0] * 8]],
            "disturbance": [0.0] * 4,
            "hover_input": [0.0, 0.0, 0.5, 0.0],
            "input_gain": [5.0, 5.0, 20.0, 10.0],
            "input_min": [-1.0, -1.0, 0.0, -1.0],
            "input_max": [1.0, 1.0, 1.0, 1.0],
        }
        self.tasks.append(task)
        return task

    def answer(self, task: dict[str, Any], inputs: list[list[float]]) -> None:
        assert task["number"] == self.number
        self.answers.append(inputs[0])
        gain, hover = np.array([5.0, 5.0, 20.0, 10.0]), np.array([0.0, 0.0, 0.5, 0.0])
        self.motion[4:] += PERIOD_S * gain * (np.array(inputs[0]) - hover)
        c, s = np.cos(self.motion[3]), np.sin(self.motion[3])
        x_rate, y_rate, *others = self.motion[4:]
        self.motion[:4] += PERIOD_S * np.array([c * x_rate - s * y_rate, s * x_rate + c * y_rate, *others])


@pytest.fixture
def vehicle() -> DoubleIntegrator:
    return DoubleIntegrator()


@pytest.fixture
def bridge(
    vehicle: DoubleIntegrator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[http_bridge.Bridge]:
    monkeypatch.setenv("HOME", str(tmp_path))
    with http_bridge.Bridge(vehicle, port=0) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def client(bridge: http_bridge.Bridge) -> Iterator[http.client.HTTPConnection]:
    connection = http.client.HTTPConnection("127.0.0.1", bridge.server_port, timeout=60)
    yield connection
    connection.close()


def asked(
    client: http.client.HTTPConnection, method: str, path: str, body: str = "", **headers: str
) -> tuple[int, str]:
    """Status and text of the reply; `headers` replace those of a program that knows the secret."""
    key = (Path.home() / ".http_bridge.key").read_text()
    client.request(method, path, body, {"X-Key": key} | headers)
    reply = client.getresponse()
    return reply.status, reply.read().decode()


def test_a_task_is_lines_of_a_name_and_numbers(client: http.client.HTTPConnection) -> None:
    status, text = asked(client, "POST", "/take")
    lines = dict(line.split(maxsplit=1) for line in text.splitlines())
    assert status == 200
    assert lines["number"] == "1"
    assert [float(word) for word in lines["motion"].split()] == [1.0, -0.5, 0.3, 0.4, 0, 0, 0, 0]
    assert [float(word) for word in lines["reference"].split()][:4] == [0.0, 0.0, 1.0, 0.0]
    assert {"disturbance", "hover_input", "input_gain", "input_min", "input_max"} < set(lines)


def test_an_answer_flies_the_vehicle_and_brings_the_next_task(
    client: http.client.HTTPConnection, vehicle: DoubleIntegrator
) -> None:
    asked(client, "POST", "/take")
    status, text = asked(client, "POST", "/answer", "1 0.1 -0.2 0.5 0")
    assert (status, text.splitlines()[0]) == (200, "number 2")
    assert vehicle.answers == [[0.1, -0.2, 0.5, 0.0]]
    assert asked(client, "POST", "/release") == (200, "released\n")
    assert not vehicle.taken


def test_forms_are_taken_as_well(client: http.client.HTTPConnection, vehicle: DoubleIntegrator) -> None:
    assert asked(client, "POST", "/take")[0] == 200
    assert vehicle.patience_s == 0.1
    assert asked(client, "POST", "/take", "patience_s=0.3")[0] == 200
    assert vehicle.patience_s == 0.3
    assert asked(client, "POST", "/take", "patience_s=long")[0] == 400
    assert asked(client, "POST", "/answer", "answer=2%200.1%20-2e-1%200.5%200")[0] == 200
    assert vehicle.answers == [[0.1, -0.2, 0.5, 0.0]]


def test_what_cannot_be_done_is_told_and_the_bridge_goes_on(
    client: http.client.HTTPConnection, vehicle: DoubleIntegrator
) -> None:
    assert asked(client, "GET", "/task") == (503, "no task for 1.0 s\n")
    assert asked(client, "GET", "/")[0] == 404
    assert asked(client, "POST", "/fly")[0] == 404
    vehicle.refusal = "h1 is on the floor"
    assert asked(client, "POST", "/take") == (409, "h1 is on the floor\n")
    vehicle.refusal = None
    assert asked(client, "POST", "/take")[0] == 200
    for body in ("", "1 2 3", "1 a b c d", "x 0 0 0 0"):
        assert asked(client, "POST", "/answer", body)[0] == 400
    assert asked(client, "POST", "/answer", "1" * 2000)[0] == 413
    assert vehicle.answers == []
    client.close()
    assert asked(client, "POST", "/answer", "1 0 0 0.5 0")[0] == 200


@pytest.mark.parametrize(("method", "path"), [("POST", "/take"), ("POST", "/answer"), ("GET", "/task")])
@pytest.mark.parametrize(
    "headers", [{"X-Key": ""}, {"X-Key": "wrong"}, {"Host": "evil.example:8050"}, {"Host": ""}]
)
def test_strangers_and_pages_of_a_browser_are_refused(
    client: http.client.HTTPConnection,
    vehicle: DoubleIntegrator,
    method: str,
    path: str,
    headers: dict[str, str],
) -> None:
    assert asked(client, method, path, "1 0 0 0.5 0" if path == "/answer" else "", **headers)[0] == 403
    assert not vehicle.taken
    assert vehicle.answers == []
    assert (Path.home() / ".http_bridge.key").stat().st_mode & 0o777 == 0o600


def test_a_browser_is_not_permitted_to_send_the_header(client: http.client.HTTPConnection) -> None:
    client.request("OPTIONS", "/take", headers={"Origin": "http://evil.example"})
    reply = client.getresponse()
    assert reply.status == 501
    assert reply.getheader("Access-Control-Allow-Headers") is None


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler on this computer")
def test_a_program_in_cpp_answers_every_task_as_the_one_in_python(
    bridge: http_bridge.Bridge, vehicle: DoubleIntegrator, tmp_path: Path
) -> None:
    binary = tmp_path / "fly"
    command = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-o", binary, EXAMPLE / "fly.cpp"]
    subprocess.run(command, check=True, timeout=300)
    subprocess.run([binary, "1.5", str(bridge.server_port)], check=True, timeout=300)
    assert_answered_like_python(vehicle)


@pytest.mark.campaign
@pytest.mark.skipif(
    shutil.which("octave-cli") is None, reason="no Octave on this computer: apt-get install octave"
)
def test_a_program_in_octave_answers_every_task_as_the_one_in_python(
    bridge: http_bridge.Bridge, vehicle: DoubleIntegrator
) -> None:
    command = ["octave-cli", "--quiet", "--norc", "--eval", f"fly_http(1, {bridge.server_port})"]
    subprocess.run(command, cwd=EXAMPLE, check=True, timeout=300)
    assert vehicle.patience_s == 0.3
    assert_answered_like_python(vehicle)


def assert_answered_like_python(vehicle: DoubleIntegrator) -> None:
    """Every task has the answer that fly.py would give, and the vehicle was given back."""
    assert not vehicle.taken
    assert len(vehicle.answers) > 5
    for task, inputs in zip(vehicle.tasks, vehicle.answers, strict=False):
        assert inputs == pytest.approx(fly.feedback(task), abs=1e-12)
