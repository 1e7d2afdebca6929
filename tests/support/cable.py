"""A cable between two Linux bridges that delays and stalls, for kernels without `tc netem`.

`python cable.py LEFT RIGHT DELAY_S JITTER_S` makes two TAP devices of these names in its network namespace,
and carries frames between them, in order, until it is ended. SIGUSR1 stalls it once.
"""

import fcntl
import os
import random
import select
import signal
import struct
import sys
import time
from collections import deque
from types import FrameType
from typing import Final

from rcopterx.bus.realtime import request_realtime

TUNSETIFF: Final = 0x400454CA
IFF_TAP: Final = 0x0002
IFF_NO_PI: Final = 0x1000
LARGEST_FRAME: Final = 65536
STALL_S: Final = 0.2
PRIORITY: Final = 60
"""Real-time priority, so that the cable never waits for a processor."""
SEED: Final = 0


def tap(name: str) -> int:
    """Descriptor of a new TAP device of this network namespace; it ends with the process."""
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TAP | IFF_NO_PI))
    return device


class Way:
    """One direction of the cable, between descriptors of TAP devices.

    Each frame takes the delay, plus or minus up to the jitter; frames do not overtake each other.
    """

    def __init__(self, source: int, sink: int, delay_s: float, jitter_s: float) -> None:
        self.source, self._sink = source, sink
        self._delay_s, self._jitter_s = delay_s, jitter_s
        self._random = random.Random(SEED)
        self._frames: deque[tuple[float, bytes]] = deque()
        self._last_s = 0.0

    def take(self, now_s: float) -> None:
        """Read a frame that has arrived."""
        try:
            frame = os.read(self.source, LARGEST_FRAME)
        except BlockingIOError:
            return
        late_s = self._delay_s + self._random.uniform(-self._jitter_s, self._jitter_s)
        self._last_s = max(self._last_s, now_s + late_s)
        self._frames.append((self._last_s, frame))

    def due_s(self) -> float | None:
        """When the next frame leaves; None without one."""
        return self._frames[0][0] if self._frames else None

    def deliver(self, now_s: float) -> None:
        """Write frames that are due."""
        while self._frames and self._frames[0][0] <= now_s:
            try:
                os.write(self._sink, self._frames.popleft()[1])
            except OSError:
                return  # The device is down or its queue is full: the frame is lost.


def main() -> None:
    """Carry frames until SIGTERM."""
    names, delay_s, jitter_s = sys.argv[1:3], float(sys.argv[3]), float(sys.argv[4])
    left, right = map(tap, names)
    ways = (Way(left, right, delay_s, jitter_s), Way(right, left, delay_s, jitter_s))
    stalled_until_s = 0.0

    def stall(_number: int, _frame: FrameType | None) -> None:
        nonlocal stalled_until_s
        stalled_until_s = time.monotonic() + STALL_S

    signal.signal(signal.SIGUSR1, stall)
    request_realtime(PRIORITY)
    print("ready", flush=True)
    poller = select.poll()
    for way in ways:
        poller.register(way.source, select.POLLIN)
    while True:
        now_s = time.monotonic()
        due = [due_s for way in ways if (due_s := way.due_s()) is not None]
        wake_s = max(min(due), stalled_until_s) if due else now_s + 1.0
        readable = {descriptor for descriptor, _ in poller.poll(max(0.0, 1e3 * (wake_s - now_s)))}
        now_s = time.monotonic()
        for way in ways:
            if way.source in readable:
                way.take(now_s)
            if now_s >= stalled_until_s:
                way.deliver(now_s)


if __name__ == "__main__":
    main()
