"""A client and a Tracker emulator on loopback, stepped in turn by one thread."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Self

from support.waiting import DEADLINE_S, PatientClock

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame
from rcopterx.vicon_gateway.client import ClientLimits, DataStreamClient
from rcopterx.vicon_gateway.frame import CapturedFrame

# Client and emulator read the clock a few times per step: no stall makes one of them silent for the other.
READING_S = 0.001
QUICK = ClientLimits(connect_s=60.0, silence_min_s=0.15, retry_min_s=0.01, retry_max_s=0.05)
PATIENT = ClientLimits(connect_s=60.0, silence_min_s=60.0, retry_min_s=0.01, retry_max_s=0.05)

BODIES = (
    TrackedBody("h1", (1.0, -2.0, 0.5), (0.0, 0.0, 0.6, 0.8)),
    TrackedBody("h2", (-1.0, 0.25, 1.5), (0.5, 0.5, 0.5, 0.5), quality=0.75),
)


class Bench:
    """Publishes a frame per `period_s`, serves the emulator, asks the client, keeps what it delivers."""

    def __init__(
        self,
        limits: ClientLimits = QUICK,
        *,
        profile: str = "tracker3",
        period_s: float = 0.005,
        record_raw: Callable[[bytes], object] | None = None,
    ) -> None:
        self.period_s = period_s
        self.clock = PatientClock(READING_S)
        self.server = TrackerServer(port=0, profile=profile, rate_hz=200.0, clock=self.clock)
        self.client = DataStreamClient(
            *self.server.address, clock=self.clock, limits=limits, record_raw=record_raw
        )
        self.frames: list[CapturedFrame] = []
        self.bodies = BODIES
        self.number = 0
        self.publishing = True
        self._next_s = 0.0
        self._stack = ExitStack()
        self._stack.callback(self.server.close)
        self._stack.callback(self.client.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def last(self) -> CapturedFrame:
        return self.frames[-1]

    def publish(self) -> None:
        self.server.publish(TrackerFrame(self.number, self.bodies))
        self.number += 1

    def step(self) -> None:
        now_s = self.clock()
        if self.publishing and now_s >= self._next_s:
            self._next_s = now_s + self.period_s
            self.publish()
        self.server.poll()
        frame = self.client.next_frame(0.0005)
        if frame is not None:
            self.frames.append(frame)

    def run_until(self, condition: Callable[[], bool]) -> None:
        give_up_s = time.monotonic() + DEADLINE_S
        while not condition():
            self.step()
            assert time.monotonic() < give_up_s, (self.client.state, self.server.clients)

    def run_frames(self, number: int) -> list[CapturedFrame]:
        """Return the next frames the client delivers."""
        start = len(self.frames)
        self.run_until(lambda: len(self.frames) >= start + number)
        return self.frames[start:]

    def run_until_up(self, connects: int = 1) -> None:
        self.run_until(lambda: self.client.state.name == "up" and self.client.state.connects >= connects)
