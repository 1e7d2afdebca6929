"""What browsers receive: the newest state at once, samples without gaps, each browser at its own pace."""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

import msgspec
from msgspec import UNSET, Raw, Struct, UnsetType
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State

from rcopterx.ground_station.page.history import KEPT_S, SAMPLE_S

PERIOD_S: Final = 0.025  # between two checks for something new
BEAT_S: Final = 0.5
"""Longest time without a message, by which browsers know that the page's process responds."""
encode = msgspec.json.encode


class Frame(Struct, frozen=True, omit_defaults=True):
    """One message to a browser."""

    motion: Raw | UnsetType = UNSET
    texts: Raw | UnsetType = UNSET
    fleet: Raw | UnsetType = UNSET
    """What does not change: vehicles, volume, what can be chosen."""
    samples: Sequence[Raw] = ()


class Seen(Struct):
    """What a browser has received."""

    motion: int = 0
    texts: int = 0
    fleet: int = 0
    samples: int = 0


class Feed:
    """The newest content of the page as JSON; written by one thread and read by another."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest = {"motion": (0, Raw()), "texts": (0, Raw()), "fleet": (0, Raw())}
        self._samples: deque[Raw] = deque(maxlen=round(KEPT_S / SAMPLE_S))
        self._sampled = 0
        self._sampled_s = float("-inf")

    def put(self, part: str, content: object) -> None:
        """Replace `motion`, `texts` or `fleet`; samples of another fleet have other vehicles."""
        encoded = Raw(encode(content))
        with self._lock:
            if part == "fleet":
                self._samples.clear()
            self._newest[part] = self._newest[part][0] + 1, encoded

    def due(self, now_s: float) -> bool:
        """Whether it is time for a sample."""
        return now_s - self._sampled_s >= 0.9 * SAMPLE_S

    def add_sample(self, now_s: float, values: Sequence[Sequence[float | None]]) -> None:
        """Add samples of all vehicles, in the order of the fleet."""
        encoded = Raw(encode([round(now_s, 2), *values]))
        with self._lock:
            self._samples.append(encoded)
            self._sampled, self._sampled_s = self._sampled + 1, now_s

    def after(self, seen: Seen) -> bytes | None:
        """Message with what is new to a browser, None if nothing is; updates `seen`."""
        with self._lock:
            parts = {
                part: content
                for part, (number, content) in self._newest.items()
                if number > getattr(seen, part)
            }
            new = self._sampled - seen.samples
            samples = tuple(self._samples)[-new:] if new else ()
            for part, (number, _) in self._newest.items():
                setattr(seen, part, number)
            seen.samples = self._sampled
        return encode(Frame(**parts, samples=samples)) if parts or samples else None

    async def stream(self, connection: ServerConnection) -> None:
        """Send what is new until the browser leaves; a slow one skips states, and no samples."""
        seen, sent_s = Seen(), 0.0
        with suppress(ConnectionClosed):
            while connection.state is State.OPEN:
                message, now_s = self.after(seen), time.monotonic()
                if message is not None or now_s - sent_s > BEAT_S:
                    sent_s = now_s
                    await connection.send(message or b"{}", text=True)
                await asyncio.sleep(PERIOD_S)
