"""Binding, range check and calibration as a user or a script runs them, with an emulated radio."""

import os
import pty
import re
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from operator import call
from pathlib import Path

import pytest
from support.radios import HandheldReceiver, serve
from support.waiting import DEADLINE_S, wait_for

from rcopterx.commands.radio_bench import workbench
from rcopterx.deploy.hosts.run_directory import run_directory, serial_path
from rcopterx.deploy.hosts.vehicle_states import begin_states, reserved_state
from rcopterx.fleet.radios import calibration_of, protocol_of
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_kinds import module_of
from rcopterx.simulator.radio_module import SerialFrame
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import ReceiverState
from rcopterx.simulator.settings import SimulatedRadio
from rcopterx.transmitter_gateway.serial_port import SerialPort

FLEET = """# Our two helicopters.
name = "lab"

[simulator]

[vehicles.h1]
subject = "heli1"
transmitter = { port = "radio-h1", model_match = 1 }

[vehicles.h2]
subject = "heli2"  # the blue one

[vehicles.h2.transmitter]
port = "radio-h2"  # left shelf
protocol = "PROTOCOL"
model_match = 2

[vehicles.h2.transmitter.calibration.throttle]
us_hover = 1530.0  # with the old battery
"""


class Laboratory:
    """Radio of h2, served in real time by a thread, and the fleet file."""

    def __init__(self, directory: Path, protocol: str) -> None:
        self.path = directory / "lab.toml"
        self.path.write_text(FLEET.replace("PROTOCOL", protocol))
        file = load_fleet(self.path)
        device = serial_path("radio-h2", run_directory(file.name, None))
        self.receiver = HandheldReceiver(2, connect_s=0.0)
        module = module_of(SimulatedRadio(protocol_of(file, "h2"), 2), time.monotonic())
        self.radio = RadioPty(device, RadioLink(module, self.receiver))
        self.protocol = protocol_of(file, "h2")
        self.frames: list[SerialFrame] = []
        self.at: list[tuple[float, Callable[[], None]]] = []
        self.weak = False
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._stop.is_set():
            now_s = time.monotonic()
            for item in [item for item in self.at if item[0] <= now_s]:
                self.at.remove(item)
                item[1]()
            serve(self.radio, now_s)
            self.frames += self.radio.link.take_frames()
            waited = [self.radio.fileno()] if self.radio.is_open else []
            select.select(waited, [], [], 0.005)

    def later(self, seconds: float, act: Callable[[], None]) -> None:
        self.at.append((time.monotonic() + seconds, act))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.radio.unplug()

    def command(self, *words: str) -> list[str]:
        return [sys.executable, "-m", "rcopterx", *words, "--fleet", str(self.path)]

    def run(self, *words: str, answers: str = "") -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(*words), input=answers, capture_output=True, text=True, timeout=300, check=False
        )

    def wait_for_frames(self, number: int) -> None:
        """Wait for frames that are sent after this call."""
        wanted = len(self.frames) + number
        wait_for(lambda: len(self.frames) >= wanted, "nothing is sent")

    def throttles(self) -> set[int]:
        return {round(frame.pulses_us[0]) for frame in self.frames}


@pytest.fixture
def laboratory(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Laboratory]:
    laboratory = Laboratory(tmp_path, getattr(request, "param", "multi"))
    yield laboratory
    laboratory.close()


@pytest.mark.integration
def test_bind_gives_the_receiver_its_number_and_a_safe_failsafe(laboratory: Laboratory) -> None:
    laboratory.receiver.enter_bind_mode()
    laboratory.receiver.model_match = None
    done = laboratory.run("bind", "h2", answers="\n")
    assert done.returncode == 0, done.stderr
    assert "press return" in done.stderr
    assert "model match 2" in done.stdout
    assert laboratory.receiver.model_match == 2
    assert any(frame.bind for frame in laboratory.frames)
    assert laboratory.throttles() == {1100}


@pytest.mark.integration
@pytest.mark.campaign
@pytest.mark.parametrize("laboratory", ["dsm2_serial"], indirect=True)
def test_board_that_binds_when_it_is_switched_on_is_waited_for(laboratory: Laboratory) -> None:
    laboratory.receiver.enter_bind_mode()
    laboratory.receiver.model_match = None
    process = subprocess.Popen(laboratory.command("bind", "h2", "--yes"), stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "Unplug the board" in process.stderr.readline()
    laboratory.later(0.3, laboratory.radio.unplug)
    laboratory.later(0.8, lambda: laboratory.radio.replug(time.monotonic()))
    assert process.wait(DEADLINE_S) == 0
    process.stderr.close()
    assert laboratory.receiver.model_match == 2


@pytest.mark.integration
def test_module_that_will_refuse_the_protocol_is_not_bound(laboratory: Laboratory) -> None:
    module = laboratory.radio.link.module
    assert isinstance(module, MultiModule)
    module.knows_dsm2 = False
    done = laboratory.run("bind", "h2", "--yes")
    assert done.returncode == 1
    assert "refuses the protocol DSM (EU builds refuse DSM2)" in done.stderr
    assert not any(frame.bind for frame in laboratory.frames)


@pytest.mark.parametrize("laboratory", ["ppm"], indirect=True)
def test_radio_that_binds_by_itself_is_said_so(laboratory: Laboratory) -> None:
    done = laboratory.run("bind", "h2", "--yes")
    assert (done.returncode, done.stderr) == (1, "error: h2: ppm: bind with the radio itself\n")


def test_number_that_another_vehicle_has_too_is_not_bound(laboratory: Laboratory) -> None:
    laboratory.path.write_text(laboratory.path.read_text().replace("model_match = 1 ", "model_match = 2 "))
    done = laboratory.run("bind", "h2", "--yes")
    assert done.returncode == 2
    assert "vehicles.h2.transmitter.model_match: 2 is also that of h1" in done.stderr
    assert not any(frame.bind for frame in laboratory.frames)


@pytest.mark.parametrize("words", [("bind", "h2", "--yes"), ("range-check", "h2"), ("calibrate", "h2")])
def test_nothing_is_possible_while_a_gateway_has_the_port(
    laboratory: Laboratory, words: tuple[str, ...]
) -> None:
    gateway = SerialPort(str(laboratory.radio.path), laboratory.protocol.line, call)
    assert gateway.service(0.0)
    done = laboratory.run(*words)
    gateway.close()
    assert done.returncode == 1
    assert "another program has it; if it is a gateway, land the fleet and stop it first" in done.stderr
    assert not laboratory.frames


def test_a_vehicle_with_an_address_that_a_gateway_serves_gets_no_packet(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.setblocking(False)
        path = tmp_path / "air.toml"
        port = f"udp://127.0.0.1:{vehicle.getsockname()[1]}"
        path.write_text(
            f'name = "air"\n[tracker]\naddress = "127.0.0.1:801"\n[vehicles.h1]\ntype = "crazyflie"\n'
            f'subject = "cf1"\ntransmitter = {{ port = "{port}" }}\n'
        )
        with (
            closing(reserved_state("h1", run_directory("air", None))),
            pytest.raises(FleetError, match="another transmitter gateway or workbench command serves it"),
            workbench(str(path), "h1") as (_, _, bench),
        ):
            bench.run(0.1)
        with pytest.raises(BlockingIOError):
            vehicle.recv(2048)
        with (
            workbench(str(path), "h1"),
            pytest.raises(FleetError, match="another transmitter gateway or workbench command serves it"),
        ):
            begin_states(["h1"], run_directory("air", None))


@pytest.mark.integration
def test_range_check_sends_weakly_with_motors_off_and_ends_at_full_power(laboratory: Laboratory) -> None:
    laboratory.receiver.in_range_check_reach = False
    process = subprocess.Popen(laboratory.command("range-check", "h2", "--seconds", "2"))
    states = set()

    def ended() -> bool:
        states.add(laboratory.radio.link.receiver.state(time.monotonic()))
        return process.poll() is not None

    wait_for(ended, "the range check does not end", 60.0)
    assert process.returncode == 0
    assert ReceiverState.FAILSAFE in states
    assert laboratory.throttles() == {1100}
    assert len({round(frame.pulses_us[2]) for frame in laboratory.frames}) > 2


def test_calibration_keeps_the_files_comments(laboratory: Laboratory) -> None:
    done = laboratory.run("calibrate", "h2", "--step", "signs", answers="y\ny\nn\n")
    assert done.returncode == 0, done.stderr
    calibration = calibration_of(load_fleet(laboratory.path), "h2")
    assert (calibration.pitch.sign, calibration.roll.sign, calibration.yaw.sign) == (1, 1, -1)
    assert calibration.yaw.slew_per_s == 8.0
    text = laboratory.path.read_text()
    for comment in ("# Our two helicopters.", "# the blue one", "# left shelf", "# with the old battery"):
        assert comment in text
    assert "yaw.sign: 1 -> -1" in done.stdout
    assert laboratory.throttles() == {1100}
    assert [path.name for path in laboratory.path.parent.iterdir() if path.name.startswith(".")] == []


ANSWERS = ("y", "n", "maybe", "y", "", "1160", "1500", "1150", "us0", "1200", "stop", "1160", "1210", "hover")


def check_dialogue(laboratory: Laboratory) -> None:
    calibration = calibration_of(load_fleet(laboratory.path), "h2")
    assert (calibration.pitch.sign, calibration.roll.sign, calibration.yaw.sign) == (1, -1, 1)
    assert (calibration.throttle.us0, calibration.throttle.us_hover) == (1150, 1210)
    assert calibration.throttle.u_hover == model_of(load_fleet(laboratory.path), "h2").hover_thrust
    assert max(laboratory.throttles()) < 1215
    wait_for(lambda: round(laboratory.frames[-1].pulses_us[0]) == 1100, "the throttle stays up")


def test_guided_calibration_takes_its_answers_from_a_pipe(laboratory: Laboratory) -> None:
    done = laboratory.run("calibrate", "h2", answers="\n".join(ANSWERS) + "\n")
    assert done.returncode == 0, done.stderr
    assert "1500 us: at most 60 us more at a time" in done.stderr
    assert "'maybe': y or n" in done.stderr
    check_dialogue(laboratory)


def test_guided_calibration_on_a_terminal_shows_what_it_asks_about(laboratory: Laboratory) -> None:
    master, slave = pty.openpty()
    process = subprocess.Popen(laboratory.command("calibrate", "h2"), stdin=slave, stdout=slave, stderr=slave)
    os.close(slave)
    heard = ""
    for answer in ANSWERS:
        heard = until_question(master)
        if "u_x" in heard:
            laboratory.wait_for_frames(10)
            assert laboratory.frames[-1].pulses_us[2] == pytest.approx(1700, abs=1)
        os.write(master, f"{answer}\n".encode())
    assert process.wait(DEADLINE_S) == 0
    os.close(master)
    check_dialogue(laboratory)


def until_question(terminal: int) -> str:
    heard = ""
    deadline_s = time.monotonic() + DEADLINE_S
    while not re.search(r"(\[y/n\]|return\.|this is it:)\s*$", heard):
        assert time.monotonic() < deadline_s, heard
        if select.select([terminal], [], [], 0.1)[0]:
            heard += os.read(terminal, 4096).decode()
    return heard


@pytest.mark.parametrize("answers", ["", "y\ny\ny\n\n1150\n"])
def test_dialogue_that_breaks_off_changes_nothing_and_ends_on_throttle_low(
    laboratory: Laboratory, answers: str
) -> None:
    before = laboratory.path.read_text()
    done = laboratory.run("calibrate", "h2", answers=answers)
    assert done.returncode == 1
    assert "without an answer; nothing was changed" in done.stderr
    assert laboratory.path.read_text() == before
    low = [round(frame.pulses_us[0]) == 1100 for frame in laboratory.frames[-20:]]
    assert all(low)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("calibrate", "h9"), "h9"),
        (("calibrate", "h2", "--step", "blades"), "unknown step 'blades'"),
    ],
)
def test_wrong_options_are_refused(laboratory: Laboratory, words: tuple[str, ...], message: str) -> None:
    done = laboratory.run(*words)
    assert done.returncode == 2
    assert message in done.stderr


def test_impossible_throttle_points_are_refused_and_not_written(laboratory: Laboratory) -> None:
    before = laboratory.path.read_text()
    answers = "\n1160\nhover\n1200\nus0\n"
    done = laboratory.run("calibrate", "h2", "--step", "throttle", answers=answers)
    assert done.returncode == 1
    assert "us_hover" in done.stderr
    assert laboratory.path.read_text() == before


def test_udev_rules_are_printed_for_every_adapter_the_page_about_hardware_names() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rcopterx", "udev-rules"], capture_output=True, text=True, check=True
    )
    assert done.stdout == Path("deploy/udev/60-rcopterx.rules").read_text()
    for chip in ("0403", "10c4", "1a86"):
        assert f'ATTRS{{idVendor}}=="{chip}' in done.stdout
