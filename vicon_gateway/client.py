"""DataStream client over TCP that connects, watches and reconnects by itself."""

import contextlib
import errno
import math
import os
import select
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Literal, NamedTuple

from msgspec.structs import replace

from rcopterx.background import Address, begin, in_thread, look_up
from rcopterx.vicon_gateway.datastream import DataStreamSession, StreamCounters
from rcopterx.vicon_gateway.frame import CapturedFrame
from rcopterx.vicon_gateway.recording import RawEvent, RawRecorder
from rcopterx.vicon_gateway.wire import WireError

DEFAULT_PORT = 801
RECEIVE_BYTES = 64 * 1024  # larger buffers come from the operating system each time, as empty pages
CONNECTING_S = 0.001  # between two checks whether a connection has been made
MAX_DRAIN_BYTES = 8 * 1024 * 1024

# Waiting pauses before a try, resolving looks a host name up, negotiating awaits offer and first frame.
StateName = Literal["waiting", "resolving", "connecting", "negotiating", "up", "closed"]


class ClientState(NamedTuple):
    """State of a client, for status messages, and as a sentence in `doing`."""

    name: StateName
    doing: str
    last_error: str | None  # why the last connection failed or ended
    connects: int
    counters: StreamCounters
    recorded_bytes: int = 0
    recording_error: str | None = None  # why the raw recording ended


class ClientLimits(NamedTuple):
    """Time limits of a client.

    `connect_s` holds for the host name, for TCP connect plus offer, and then once more for the first frame. A
    connection without frames for `silence_periods`, but at least `silence_min_s`, is closed. The pause before
    the next try doubles from `retry_min_s` to `retry_max_s`, and starts again once frames arrived.
    """

    connect_s: float = 3.0
    silence_periods: float = 5.0
    silence_min_s: float = 0.1
    retry_min_s: float = 0.1
    retry_max_s: float = 2.0


class LibraryMissingError(ValueError):
    """The library `motioncapture` is not installed."""


class LinkError(Exception):
    """The connection to a source of frames has failed; the text is the reason."""


class FrameClient(ABC):
    """A source of frames that connects and reconnects by itself, in times of a clock of `speed`.

    `next_frame` never raises for trouble with the source; `state` describes it.
    """

    def __init__(self, clock: Callable[[], float], limits: ClientLimits, speed: float = 1.0) -> None:
        self._clock, self._speed = clock, speed
        self._limits = limits
        self._counters = StreamCounters()
        self._name: StateName = "waiting"
        self._last_error: str | None = None
        self._connects = 0
        self._recorder: RawRecorder | None = None
        self._pause_s = limits.retry_min_s
        self._deadline_s = clock()

    @property
    def state(self) -> ClientState:
        """State of the client now."""
        return ClientState(
            name=self._name,
            doing=self._sentence(),
            last_error=self._last_error,
            connects=self._connects,
            counters=replace(self._counters),
            recorded_bytes=0 if self._recorder is None else self._recorder.recorded_bytes,
            recording_error=None if self._recorder is None else self._recorder.error,
        )

    @abstractmethod
    def _sentence(self) -> str:
        """What the client does, for people."""

    def next_frame(self, timeout_s: float) -> CapturedFrame | None:
        """Wait at most `timeout_s` for the newest frame; earlier ones count as skipped. Connects, too."""
        now_s = self._clock()
        give_up_s = now_s + timeout_s
        while self._name != "closed":
            frame = self._step(give_up_s, now_s)
            if frame is not None:
                return frame
            now_s = self._clock()
            if now_s >= give_up_s:
                return None
        return None

    def _step(self, give_up_s: float, now_s: float) -> CapturedFrame | None:
        """Wait for one event at most until `give_up_s` and handle it; a failure begins a pause."""
        try:
            return self._advance(max(0.0, min(give_up_s, self._deadline_s) - now_s) / self._speed)
        except (LinkError, WireError, OSError) as error:
            self._last_error = self._reason(error)
            self._hang_up(self._last_error)
            self._name = "waiting"
            self._deadline_s = self._clock() + self._pause_s
            self._pause_s = min(2.0 * self._pause_s, self._limits.retry_max_s)
            return None

    @abstractmethod
    def _advance(self, timeout_s: float) -> CapturedFrame | None:
        """Wait for one event and handle it; raises `LinkError`, `WireError` or `OSError`."""

    @abstractmethod
    def _reason(self, error: Exception) -> str:
        """Why the connection has failed."""

    @abstractmethod
    def _hang_up(self, reason: str) -> None:
        """End the connection, if there is one."""

    @property
    def descriptors(self) -> tuple[int, ...]:
        """What becomes readable when a frame arrives, for a client that reads by itself."""
        return ()

    def close(self) -> None:
        """End the connection; `next_frame` returns None from now on."""
        self._hang_up("closed by the user")
        self._name = "closed"

    def _received(self, now_s: float, period_s: float) -> None:
        """Note that a frame has been received."""
        self._name = "up"
        self._pause_s = self._limits.retry_min_s
        self._deadline_s = now_s + self._silence_limit_s(period_s)

    def _silence_limit_s(self, period_s: float) -> float:
        return max(self._limits.silence_periods * period_s, self._limits.silence_min_s)


class DataStreamClient(FrameClient):
    """Frames of a Tracker, newest first; `record_raw` writes a recording of all received bytes.

    With `at_once`, for lockstep, a call ends only when no connection is being made.
    """

    def __init__(
        self,
        host: str,
        port: int = DEFAULT_PORT,
        *,
        clock: Callable[[], float] = time.monotonic,
        speed: float = 1.0,
        limits: ClientLimits | None = None,
        record_raw: Callable[[bytes], object] | None = None,
        at_once: bool = False,
    ) -> None:
        self._host, self._port, self._at_once = host, port, at_once
        super().__init__(clock, ClientLimits() if limits is None else limits, speed)
        self._recorder = None if record_raw is None else RawRecorder(record_raw, clock)
        self._socket: socket.socket | None = None
        self._poller, self._events = select.poll(), 0
        self._lookup: Future[Address] | None = None
        self._session = DataStreamSession()
        self._unsent = b""
        self._tries = 0

    @property
    def descriptors(self) -> tuple[int, ...]:
        """See `FrameClient`."""
        return () if self._socket is None else (self._socket.fileno(),)

    def next_frame(self, timeout_s: float) -> CapturedFrame | None:
        """See `FrameClient`."""
        frame = super().next_frame(timeout_s)
        while self._at_once and self._name in ("resolving", "connecting"):
            time.sleep(CONNECTING_S)
            frame = super().next_frame(0.0)
        return frame

    def _advance(self, timeout_s: float) -> CapturedFrame | None:
        if self._socket is not None and self._name != "connecting":
            return self._exchange(self._socket, timeout_s)
        if self._name == "waiting":
            self._wait(timeout_s)
        elif self._name == "resolving":
            self._resolve(timeout_s)
        else:
            self._connect(timeout_s)
        return None

    def _wait(self, pause_s: float) -> None:
        if pause_s > 0.0:
            time.sleep(pause_s)
        if self._clock() >= self._deadline_s:
            self._tries += 1
            self._lookup = begin(in_thread, partial(look_up, self._host, self._port))
            self._name = "resolving"
            self._deadline_s = self._clock() + self._limits.connect_s

    def _resolve(self, timeout_s: float) -> None:
        assert self._lookup is not None
        try:
            address = self._lookup.result(timeout_s)
        except TimeoutError:
            if self._clock() >= self._deadline_s:
                raise LinkError(f"host {self._host!r}: no answer to the look-up") from None
            return
        except OSError as error:
            raise LinkError(f"host {self._host!r}: {error}") from None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        self._poller, self._events = select.poll(), 0
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._name = "connecting"
        self._deadline_s = self._clock() + self._limits.connect_s
        code = self._socket.connect_ex(address)
        if code not in (0, errno.EINPROGRESS):
            raise OSError(code, os.strerror(code))

    def _connect(self, timeout_s: float) -> None:
        assert self._socket is not None
        if not self._poll(self._socket, select.POLLOUT, timeout_s):
            if self._clock() >= self._deadline_s:
                raise LinkError(f"no answer within {self._limits.connect_s} s (wrong address? firewall?)")
            return
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code != 0:
            raise OSError(code, os.strerror(code))
        self._connects += 1
        self._session = DataStreamSession(self._connects, self._counters)
        self._unsent = b""
        self._name = "negotiating"
        if self._recorder is not None:
            self._recorder.record(RawEvent.OPENED)

    def _poll(self, link: socket.socket, events: int, timeout_s: float) -> bool:
        """Wait until the socket is ready; True when it is."""
        if events != self._events:
            self._poller.register(link, events)
            self._events = events
        return bool(self._poller.poll(math.ceil(timeout_s * 1000.0)))

    def _exchange(self, link: socket.socket, timeout_s: float) -> CapturedFrame | None:
        self._poll(link, select.POLLIN | select.POLLOUT if self._unsent else select.POLLIN, timeout_s)
        had_offer = self._session.offer is not None
        now_s = self._receive(link)
        self._send(link)
        frame = self._session.take_frame()
        if frame is not None:
            self._received(now_s, frame.period_s)
        elif self._session.offer is not None and not had_offer:
            self._deadline_s = now_s + self._limits.connect_s
        elif now_s >= self._deadline_s:
            raise LinkError(self._silence())
        return frame

    def _receive(self, link: socket.socket) -> float:
        """Read all that is there, so that only the newest frame is delivered; return when that was."""
        drained, now_s = 0, self._clock()
        while drained < MAX_DRAIN_BYTES:
            try:
                data = link.recv(RECEIVE_BYTES)
            except BlockingIOError:
                break
            if not data:
                if drained:
                    break  # data before the end is delivered first; the next call meets the end again
                raise LinkError("the server closed the connection")
            if drained:
                now_s = self._clock()
            drained += len(data)
            if self._recorder is not None:
                self._recorder.record(RawEvent.RECEIVED, data)
            self._session.feed(data, now_s)
        return now_s

    def _send(self, link: socket.socket) -> None:
        self._unsent += self._session.take_outgoing()
        if self._unsent:
            with contextlib.suppress(BlockingIOError):
                self._unsent = self._unsent[link.send(self._unsent) :]

    def _silence(self) -> str:
        if self._session.offer is None:
            return f"connected, but no offer within {self._limits.connect_s} s: not a DataStream server?"
        if self._name == "negotiating" or self._session.period_s is None:
            return f"no frame with segments within {self._limits.connect_s} s after the selection"
        return f"no frame for {self._silence_limit_s(self._session.period_s):.3g} s"

    def _reason(self, error: Exception) -> str:
        self._counters.rejected += isinstance(error, WireError)
        return (error.strerror if isinstance(error, OSError) else None) or str(error)

    def _hang_up(self, reason: str) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            if self._recorder is not None and self._name in ("negotiating", "up"):
                self._recorder.record(RawEvent.ENDED, reason.encode())

    def _sentence(self) -> str:
        where = f"{self._host}:{self._port}"
        period_s = self._session.period_s
        if self._name == "waiting":
            pause_s = max(0.0, self._deadline_s - self._clock())
            text = f"trying {where} again in {pause_s:.1f} s (try {self._tries + 1})"
        elif self._name == "resolving":
            text = f"looking up host {self._host} (try {self._tries})"
        elif self._name == "connecting":
            text = f"connecting to {where} (try {self._tries})"
        elif self._name == "negotiating":
            waiting_for = "the offer" if self._session.offer is None else "the first frame with segments"
            text = f"connected to {where}, waiting for {waiting_for}"
        elif self._name == "up" and period_s is not None:
            text = f"receiving {1.0 / period_s:.4g} Hz from {where}"
        else:
            text = f"closed, was {where}"
        recording_error = None if self._recorder is None else self._recorder.error
        return text if recording_error is None else f"{text}; {recording_error}"
