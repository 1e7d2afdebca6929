"""Other motion-capture brands through the `motioncapture` library, in a process of its own.

The library blocks without a limit, keeps the interpreter's lock while it connects, and never notices that its
server has gone. It therefore runs in a child process (``python -m vicon_gateway.brands``) that writes its
frames to a pipe; the parent watches, kills and restarts it, and never imports the library.

The library has neither frame numbers nor times: the child counts frames from 0, so a lost frame cannot be
seen, and every restart of the child begins at 0 again, which begins a new epoch. A body that is not seen is
missing from the library's answer: the bodies seen since the start of the child are the subjects.
"""

import ctypes
import itertools
import json
import math
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import msgpack
import msgspec

from rcopterx.vicon_gateway.client import ClientLimits, FrameClient, LibraryMissingError, LinkError
from rcopterx.vicon_gateway.frame import CapturedFrame, SubjectPose
from rcopterx.vicon_gateway.rotations import MAX_POSITION_MM

BRANDS: Mapping[str, tuple[str, ...]] = {
    "optitrack": ("hostname", "interface_ip", "port_command"),
    "qualisys": ("hostname", "port"),
    "vrpn": ("hostname",),
    "vicon": ("hostname", "enable_objects", "enable_pointclout"),
    "mock": ("rigid_bodies", "frequency"),
}
"""Back-ends compiled into the library's wheel and their settings, spelt as the library spells them."""

DEFAULT_LIMITS = ClientLimits(connect_s=15.0, silence_min_s=0.5)
"""The library searches for a server every 5 s, and a new child takes about half a second to start."""

MISSING_LIBRARY = "the library motioncapture is not installed: pip install 'rcopterx[mocap]'"
MAX_MESSAGE_BYTES = 1024 * 1024
READ_BYTES = 64 * 1024
MOST_READS = 16  # at once
MAX_POSITION_M = MAX_POSITION_MM / 1000.0
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class BrandSettings:
    """A motion capture that the library reads, with what it does not report: capture rate and latency.

    Raises `ValueError` for an unknown brand or option, or a rate or latency out of range.
    """

    brand: str
    options: Mapping[str, str]
    rate_hz: float
    latency_s: float = 0.0

    def __post_init__(self) -> None:
        if self.brand not in BRANDS:
            raise ValueError(f"brand {self.brand!r}: allowed are {', '.join(BRANDS)}")
        allowed = BRANDS[self.brand]
        for key in self.options:
            if key not in allowed:
                raise ValueError(f"setting {key!r} of {self.brand}: allowed are {', '.join(allowed)}")
        if not 0.0 < self.rate_hz <= 10_000.0:
            raise ValueError(f"rate_hz {self.rate_hz}: allowed is more than 0, at most 10000")
        if not 0.0 <= self.latency_s <= 1.0:
            raise ValueError(f"latency_s {self.latency_s}: allowed is 0 to 1")


class Body(msgspec.Struct, frozen=True, array_like=True):
    """One body the library sees."""

    name: str
    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]


class Seen(msgspec.Struct, frozen=True, tag=True):
    """Message of the child: one frame."""

    frame: int
    bodies: tuple[Body, ...]


class Failed(msgspec.Struct, frozen=True, tag=True):
    """Message of the child: it gives up."""

    error: str


class _Child:
    """The child process and the messages it has written."""

    def __init__(self, settings: BrandSettings) -> None:
        command = [
            sys.executable,
            "-m",
            "rcopterx.vicon_gateway.brands",
            settings.brand,
            json.dumps(dict(settings.options)),
            str(os.getpid()),
        ]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C in the terminal is for the parent to handle
        )
        assert self._process.stdout is not None
        self._pipe = self._process.stdout.fileno()
        os.set_blocking(self._pipe, False)
        self._unpacker = msgpack.Unpacker(max_buffer_size=MAX_MESSAGE_BYTES)
        self._poller = select.poll()
        self._poller.register(self._pipe, select.POLLIN)

    def read(self, timeout_s: float) -> list[Seen]:
        """Wait for messages and return all that are there; raises `LinkError` when none will come."""
        self._poller.poll(math.ceil(timeout_s * 1000.0))
        found: list[Seen] = []
        for _ in range(MOST_READS):
            try:
                data = os.read(self._pipe, READ_BYTES)
            except BlockingIOError:
                break
            if not data:
                if found:
                    break  # the next call meets the end again
                raise LinkError(f"its process ended with code {self._process.wait()}")
            found += self._messages(data)
        return found

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def _messages(self, data: bytes) -> list[Seen]:
        """Messages that these bytes complete."""
        found: list[Seen] = []
        try:
            self._unpacker.feed(data)
            for plain in self._unpacker:
                message = msgspec.convert(plain, Seen | Failed)
                if isinstance(message, Failed):
                    raise LinkError(message.error)
                found.append(message)
        except (ValueError, msgpack.UnpackException, msgspec.ValidationError) as error:
            raise LinkError(f"its process sends a malformed message: {error}") from error
        return found


class BrandClient(FrameClient):
    """Frames of a motion-capture system of another brand; the interface of `client.DataStreamClient`.

    For one thread, with which the child dies. `limits.connect_s` is from start to first frame.
    """

    def __init__(
        self,
        settings: BrandSettings,
        clock: Callable[[], float] = time.monotonic,
        limits: ClientLimits = DEFAULT_LIMITS,
        speed: float = 1.0,
    ) -> None:
        super().__init__(clock, limits, speed)
        self._settings = settings
        self._period_s = 1.0 / settings.rate_hz
        self._child: _Child | None = None
        self._subjects: dict[str, None] = {}

    def _reason(self, error: Exception) -> str:
        return f"{self._settings.brand}: {error}"

    def _advance(self, timeout_s: float) -> CapturedFrame | None:
        if self._child is None:
            if timeout_s > 0.0:
                time.sleep(timeout_s)
            if self._clock() >= self._deadline_s:
                self._start()
            return None
        seen = self._child.read(timeout_s)
        now_s = self._clock()
        if seen:
            self._received(now_s, self._period_s)
            return self._frame(seen, now_s)
        if now_s >= self._deadline_s:
            limit_s = (
                self._limits.connect_s
                if self._name == "connecting"
                else self._silence_limit_s(self._period_s)
            )
            raise LinkError(f"no frame for {limit_s:.3g} s")
        return None

    def _start(self) -> None:
        self._connects += 1
        self._subjects = {}
        self._name = "connecting"
        self._deadline_s = self._clock() + self._limits.connect_s
        self._child = _Child(self._settings)

    def _frame(self, seen: list[Seen], now_s: float) -> CapturedFrame:
        self._counters.frames += 1
        self._counters.skipped += len(seen) - 1
        for message in seen:
            self._subjects.update(dict.fromkeys(body.name for body in message.bodies))
        bodies = {body.name: body for body in seen[-1].bodies}
        poses = tuple(self._pose(name, bodies.get(name)) for name in self._subjects)
        latency_s = self._settings.latency_s
        return CapturedFrame(seen[-1].frame, self._connects, self._period_s, now_s, latency_s, poses)

    def _pose(self, name: str, body: Body | None) -> SubjectPose:
        if body is None:
            return SubjectPose(name, True, None, None, None)
        x, y, z, w = body.quaternion_xyzw
        norm = math.hypot(x, y, z, w)
        within = all(abs(value) <= MAX_POSITION_M for value in body.position_m)
        if not (within and abs(norm - 1.0) <= 1e-3):
            self._counters.rejected += 1
            return SubjectPose(name, True, None, None, None)
        scale = math.copysign(1.0 / norm, w)
        return SubjectPose(name, False, body.position_m, (x * scale, y * scale, z * scale, w * scale), None)

    def _hang_up(self, reason: str) -> None:  # noqa: ARG002 - nothing records it
        if self._child is not None:
            self._child.kill()
            self._child = None

    def _sentence(self) -> str:
        options = ", ".join(f"{key} {value}" for key, value in self._settings.options.items())
        where = f"{self._settings.brand} ({options})"
        if self._name == "waiting":
            pause_s = max(0.0, self._deadline_s - self._clock())
            return f"starting {where} again in {pause_s:.1f} s (try {self._connects + 1})"
        if self._name == "connecting":
            return f"waiting for the first frame of {where} (try {self._connects})"
        return f"receiving from {where}" if self._name == "up" else f"closed, was {where}"


def check_library() -> None:
    """Raise `LibraryMissingError` if the library is not installed, without importing it."""
    if find_spec("motioncapture") is None:
        raise LibraryMissingError(MISSING_LIBRARY)


def run_child(brand: str, settings: dict[str, str], parent: int) -> int:
    """Write frames of the library to standard output until killed; returns the exit code of a failure."""
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the library's own messages do not belong into the data
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    # A library that spins must not do so with the real-time priority of the gateway.
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    if os.getppid() != parent:
        return 1  # the parent was gone before it could be tied to this process

    def write(message: Seen | Failed) -> None:
        pipe.write(msgspec.msgpack.encode(message))
        pipe.flush()

    try:
        import motioncapture

        capture = motioncapture.connect(brand, settings)
        for number in itertools.count():
            capture.waitForNextFrame()
            bodies = capture.rigidBodies.values()
            write(Seen(number, tuple(_body(body.name, body.position, body.rotation) for body in bodies)))
    except ImportError:
        write(Failed(MISSING_LIBRARY))
    except (RuntimeError, ValueError, KeyError) as error:
        write(Failed(str(error)))
    return 1


def _body(name: str, position: Sequence[float], rotation: Any) -> Body:
    x, y, z = (float(value) for value in position)
    quaternion = (float(rotation.x), float(rotation.y), float(rotation.z), float(rotation.w))
    return Body(name, (x, y, z), quaternion)


if __name__ == "__main__":
    sys.exit(run_child(sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3])))
