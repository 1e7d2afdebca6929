"""A Tracker emulator that runs by itself, in a thread, for tests of what reads it."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame

PERIOD_S = 0.01


def moving_body(name: str, number: int) -> TrackedBody:
    """A body that is somewhere else in every frame."""
    return TrackedBody(name, (0.001 * number, -0.5, 1.0), (0.0, 0.0, 0.6, 0.8))


@contextmanager
def running_tracker(
    *names: str, body: Callable[[str, int], TrackedBody] = moving_body
) -> Iterator[TrackerServer]:
    """Publish these subjects at 100 Hz until the end of the block."""
    stopping = threading.Event()
    with closing(TrackerServer(port=0, rate_hz=1 / PERIOD_S)) as server:

        def run() -> None:
            number, next_s = 0, time.monotonic()
            while not stopping.is_set():
                server.poll(PERIOD_S / 4)
                if time.monotonic() >= next_s:
                    server.publish(TrackerFrame(number, tuple(body(name, number) for name in names)))
                    number, next_s = number + 1, next_s + PERIOD_S

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield server
        finally:
            stopping.set()
            thread.join()
