"""Promises to people at a terminal: what they want to do takes no longer than this, or no more lines."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from support.browsing import CHROMIUM, IN_A_BROWSER, NEEDED, SOFTWARE_RENDERING
from support.bus import free_port
from support.waiting import DEADLINE_S

from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.csv_export import export_csv

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "tests" / "fixtures" / "reference_flight.mcap"
TRIO = ROOT / "fleet" / "fleets" / "trio.toml"
FIRST_DRAG_S = 25.0  # from the command to a vehicle that follows the hand
FIRST_FILE_S, ANSWER_S = 300.0, 20.0  # to a fleet file; to read a question and type its answer
PROMPT = r"[^\n]*: $"


class Terminal:
    """A command in a terminal of its own; `shown` is what it has printed."""

    def __init__(self, *words: str) -> None:
        self._outside, inside = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rcopterx", *words], stdin=inside, stdout=inside, stderr=inside,
            env=os.environ | {"TERM": "dumb", "COLUMNS": "300"},
        )  # fmt: skip
        os.close(inside)
        self.shown = ""

    def _read(self) -> bool:
        """Read what there is; False once the command has ended."""
        if not select.select([self._outside], [], [], 0.1)[0]:
            return True
        try:
            self.shown += os.read(self._outside, 65536).decode(errors="replace").replace("\r", "")
        except OSError:
            return False
        return True

    def wait_for(self, pattern: str, from_place: int = 0) -> re.Match[str]:
        """Wait until the text from a place on has a pattern."""
        end_s = time.monotonic() + DEADLINE_S
        while (found := re.compile(pattern).search(self.shown, from_place)) is None:
            assert time.monotonic() < end_s, f"no {pattern}: {self.shown}"
            assert self._read(), f"ended without {pattern}: {self.shown}"
        return found

    def type(self, answer: str) -> None:
        """Type a line once something is asked."""
        self.wait_for(PROMPT, self.shown.rfind("\n") + 1)
        at = len(self.shown)
        os.write(self._outside, f"{answer}\n".encode())
        self.wait_for(r"\n", at)

    def end(self) -> int:
        """Wait for the end of the command."""
        while self._read():
            pass
        return self.process.wait(DEADLINE_S)

    def close(self) -> None:
        """Interrupt the command if it has not ended."""
        with suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGINT)
        self.end()
        os.close(self._outside)


@contextmanager
def terminal(*words: str) -> Iterator[Terminal]:
    """A command in a terminal until the block is left."""
    running = Terminal(*words)
    try:
        yield running
    finally:
        running.close()


def first_file(file: Path, *answers: str) -> FleetFile:
    """Answer what `new-lab` asks; the file has to be there before a patient person gives up."""
    began_s = time.monotonic()
    with terminal("new-lab", str(file)) as shown:
        for answer in answers:
            shown.type(answer)
        assert shown.end() == 0, shown.shown
        took_s = time.monotonic() - began_s + ANSWER_S * len(answers)
        assert took_s <= FIRST_FILE_S
        assert f"rcopterx up {file}" in shown.shown, "the next steps are not said"
    return load_fleet(file)


def test_the_first_file_of_two_crazyflies_with_an_optitrack_takes_five_minutes(tmp_path: Path) -> None:
    fleet = first_file(
        tmp_path / "lab.toml",
        "optitrack", "10.0.0.5:1510", "200", "cf1, cf2", "crazyflie", "", "", "radio://0/80/2M/E7E7E7E7E7",
        "-1,-1,0", "1,1,2",
    )  # fmt: skip
    assert (fleet.tracker.brand, fleet.tracker.rate_hz) == ("optitrack", 200.0)
    assert [one.type for one in fleet.vehicles.values()] == ["crazyflie", "crazyflie"]


def test_the_first_file_of_three_helicopters_with_a_vicon_takes_five_minutes(tmp_path: Path) -> None:
    radios = [f"/dev/serial/by-id/usb-FTDI_{number}" for number in range(3)]
    fleet = first_file(
        tmp_path / "lab.toml",
        "vicon", "127.0.0.1:1", "heli1, heli2, heli3", "coaxial", radios[0], "", radios[1], "", radios[2],
        "-1,-1,0", "1,1,2",
    )  # fmt: skip
    assert fleet.tracker.brand == "vicon"
    assert [one.type for one in fleet.vehicles.values()] == 3 * ["coaxial"]
    assert [one.transmitter.port for one in fleet.vehicles.values()] == radios


def test_plans_of_a_flight_are_in_pandas_with_three_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pandas")
    page = (ROOT / "docs" / "logs.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(import pandas.*?)```", page, flags=re.S)
    assert code is not None
    assert len([line for line in code[1].splitlines() if line]) <= 3
    export_csv([REFERENCE], tmp_path / "tables")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(code[1], names)
    shapes = [names[f"{axis}_m"].shape for axis in "xyz"]  # type: ignore[attr-defined]
    assert shapes[0] == shapes[1] == shapes[2]
    assert min(shapes[0]) > 1


LINK = re.compile(r"\]\(([\w-]+\.md)")


@pytest.mark.parametrize("page", ["hardware.md", "crazyflie.md", "flight_controllers.md", "mavlink.md"])
def test_the_page_of_every_radio_is_one_click_from_the_first_page(page: str) -> None:
    first = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert page in LINK.findall(first)


class TestInABrowser:
    """What needs a browser beside the terminal."""

    pytestmark = IN_A_BROWSER

    def test_a_vehicle_of_the_demonstration_is_dragged_within_25_seconds(self, tmp_path: Path) -> None:
        sync_api = pytest.importorskip("playwright.sync_api", reason=NEEDED)
        path = tmp_path / "demonstration.toml"
        text = TRIO.read_text(encoding="utf-8").replace("18801", str(free_port()))
        path.write_text(f"{text}\n[hosts.main]\nrouter_port = {free_port()}\n", encoding="utf-8")
        with sync_api.sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_RENDERING)
            window = browser.new_page()
            began_s = time.monotonic()
            with terminal("demo", "--no-record", "-f", str(path)) as shown:
                window.goto(shown.wait_for(r"http://\S+")[0])
                handle = window.locator(".handle:not(.lift)[data-vehicle=h1]")
                handle.wait_for(timeout=1000 * DEADLINE_S)
                box = handle.bounding_box()
                window.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
                window.mouse.down()
                window.mouse.move(box["x"] + 40, box["y"] + 10, steps=4)
                window.mouse.up()
                window.locator(".notice", has_text="h1: on its way").wait_for(timeout=1000 * DEADLINE_S)
                took_s = time.monotonic() - began_s
                print(f"dragged after {took_s:.1f} s")
            browser.close()
        assert took_s <= FIRST_DRAG_S
