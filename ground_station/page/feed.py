"""What browsers receive: the newest state at once, samples without gaps, each browser at its own pace."""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

import msgspec
from msgspec import Raw
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State

from rcopterx.ground_station.page.history import KEPT_S, SAMPLE_S

PERIOD_S: Final = 0.025  # between two checks for something new
BEAT_S: Final = 0.5  # longest time without a message, by which browsers know that the process responds
PARTS: Final = ("motion", "texts", "fleet")  # change often, less often, and never
Seen = dict[str, int]  # what a browser has received: numbers by part
encode = msgspec.json.encode


class Feed:
    """The newest content of the page as JSON; written by one thread and read by another."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest = dict.fromkeys(PARTS, (0, Raw()))
        self._samples: deque[Raw] = deque(maxlen=round(KEPT_S / SAMPLE_S))
        self._sampled = 0

    def put(self, part: str, content: object) -> None:
        """Replace one of `PARTS`; samples of another fleet have other vehicles."""
        encoded = Raw(encode(content))
        with self._lock:
            if part == "fleet":
                self._samples.clear()
            self._newest[part] = self._newest[part][0] + 1, encoded

    def add_sample(self, now_s: float, values: Sequence[Sequence[float | None]]) -> None:
        """Add samples of all vehicles, in the order of the fleet."""
        encoded = Raw(encode([round(now_s, 2), *values]))
        with self._lock:
            self._samples.append(encoded)
            self._sampled += 1

    def after(self, seen: Seen) -> bytes | None:
        """Message with what is new to a browser, None if nothing is; updates `seen`."""
        with self._lock:
            message: dict[str, object] = {
                part: content
                for part, (number, content) in self._newest.items()
                if number > seen.get(part, 0)
            }
            if new := self._sampled - seen.get("samples", 0):
                message["samples"] = list(self._samples)[-new:]
            seen |= {part: number for part, (number, _) in self._newest.items()} | {"samples": self._sampled}
        return encode(message) if message else None

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
