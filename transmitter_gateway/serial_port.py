"""Serial port for a control loop: never blocks, queues no stale frames."""

import errno
import fcntl
import math
import os
import select
import struct
import termios
from concurrent.futures import Future
from contextlib import suppress
from functools import partial

import serial

from rcopterx.background import Start, begin, in_thread
from rcopterx.radios.protocol import SerialLine
from rcopterx.transmitter_gateway.port import Port, WriteOutcome

TCGETS2 = 0x802C542A
SPEEDS = struct.Struct("36x2I")  # those of the receiver and the sender in `struct termios2`

RETRY_S = 0.15
SLOW_OPENING_S = 1.0
SILENCE_AFTER_SHORT_WRITE_S = 0.002
LONGEST_BACKLOG_S = 0.1
READ_SIZE = 4096

IN_USE = "another program has it"
REASONS = {
    errno.EAGAIN: IN_USE,  # locked
    errno.EBUSY: IN_USE,  # in exclusive mode, for users who are not root
    errno.ENOENT: "there is no such device; is the adapter plugged in?",
    errno.EACCES: "no permission; sudo usermod -aG dialout $USER, then log in again",
}
"""Reasons why a device cannot be opened that are clearer than those of the operating system."""


def reason_of(error: Exception) -> str:
    """Why a device cannot be opened, in words for people; the library wraps the system's in its own."""
    number = error.args[0] if error.args else None
    if not isinstance(number, int):
        return str(error)
    return REASONS.get(number, os.strerror(number))


class SerialPort(Port):
    """A serial device; see `Port`.

    A frame is dropped rather than queued behind bytes that are still to be sent, and after a short write the
    line stays silent until the receiver has discarded the fragment. A back-log of more than 100 ms closes the
    port.

    `start`: runs openings and closings, which an adapter can block for seconds.
    """

    retry_s = RETRY_S

    def __init__(self, path: str, line: SerialLine, start: Start = in_thread) -> None:
        super().__init__(path)
        self.line = line
        self._start = start
        self._serial: serial.Serial | None = None
        self._descriptor: int | None = None
        self._opening: Future[serial.Serial] | None = None
        self._opening_since_s = -math.inf
        self._silent_until_s = -math.inf
        self._backlog_since_s: float | None = None

    def fileno(self) -> int | None:
        """File descriptor to wait for answers on, None while closed."""
        return self._descriptor

    @property
    def is_opening(self) -> bool:
        """True while an attempt to open the port is under way."""
        return self._opening is not None and not self._opening.done()

    @property
    def next_attempt_s(self) -> float:
        """When `service` has something to do again [s]; infinite while open, and while it is being opened."""
        if self.is_open or self.is_opening:
            return math.inf
        return self._next_attempt_s if self._opening is None else -math.inf

    def service(self, now_s: float) -> bool:
        """Open the port if it is closed and an attempt is due; return True once, when it is open."""
        if self.is_open or (self._opening is None and now_s < self._next_attempt_s):
            return False
        try:
            if self._opening is None:
                self._opening_since_s = now_s
                self._opening = begin(self._start, partial(open_serial, self.path, self.line))
            if not self._opening.done():
                if now_s > self._opening_since_s + SLOW_OPENING_S:
                    self.problem = f"{self.path} does not open; unplug the adapter"
                return False
            self._serial = self._opening.result()
        except (OSError, termios.error, ValueError, RuntimeError) as error:
            self._lose(f"cannot open {self.path}: {reason_of(error)}", now_s)
            return False
        self._opening = None
        self._descriptor = int(self._serial.fileno())
        self.problem = None
        self._silent_until_s = -math.inf
        self._backlog_since_s = None
        self.counters["openings"] += 1
        return True

    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:
        port, descriptor = self._serial, self._descriptor
        if port is None or descriptor is None:
            return WriteOutcome.CLOSED
        if now_s < self._silent_until_s:
            return WriteOutcome.SILENT
        try:
            if port.out_waiting > len(frame):
                return self._backlog(now_s)
            written = os.write(descriptor, frame)
        except BlockingIOError:
            return self._backlog(now_s)
        except (OSError, termios.error) as error:
            self._lose(f"write to {self.path} failed: {error}", now_s)
            return WriteOutcome.FAILED
        if written < len(frame):
            self._silent_until_s = now_s + SILENCE_AFTER_SHORT_WRITE_S
            return WriteOutcome.SHORT
        self._backlog_since_s = None
        return WriteOutcome.WRITTEN

    def _backlog(self, now_s: float) -> WriteOutcome:
        if self._backlog_since_s is None:
            self._backlog_since_s = now_s
        elif now_s - self._backlog_since_s > LONGEST_BACKLOG_S:
            self._lose(f"{self.path} takes no bytes for {LONGEST_BACKLOG_S:g} s", now_s)
        return WriteOutcome.BACKLOG

    def read_available(self, now_s: float) -> bytes:
        """Return the bytes that have arrived, possibly none."""
        descriptor = self._descriptor
        if descriptor is None:
            return b""
        try:
            # An idle terminal reads as nothing, like one that is gone: only "readable" distinguishes them.
            if not select.select([descriptor], [], [], 0)[0]:
                return b""
            data = os.read(descriptor, READ_SIZE)
        except (OSError, termios.error) as error:
            self._lose(f"read from {self.path} failed: {error}", now_s)
            return b""
        if not data:
            self._lose(f"{self.path} was unplugged", now_s)
        return data

    def close(self) -> None:
        """Close the port, and discard what is still to be sent; `service` would open it again."""
        port, opening = self._serial, self._opening
        self._serial = self._descriptor = self._opening = None
        self.problem = "closed"
        if opening is not None:
            opening.add_done_callback(_shut_unused)
        if port is None:
            return
        try:
            self._start(partial(_shut, port))
        except RuntimeError:  # The system allows no further thread.
            _shut(port)


def open_serial(path: str, line: SerialLine) -> serial.Serial:
    """Open a device exclusively; raises `OSError`, `termios.error` or `ValueError`. It may block."""
    port = serial.Serial()
    port.port = path
    port.baudrate = line.baud
    port.bytesize = serial.EIGHTBITS
    port.parity = line.parity
    port.stopbits = line.stop_bits
    port.timeout = 0
    port.exclusive = True
    # On many boards these lines reset the processor or switch the module's power.
    port.dtr = False
    port.rts = False
    port.open()
    try:
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
        if not hasattr(termios, f"B{line.baud}"):
            check_baud(port.fileno(), line.baud)
    except BaseException:
        port.close()
        raise
    return port


def _shut(port: serial.Serial) -> None:
    """Close a port, also after its device has gone; bytes that are still to be sent would block that."""
    failures = suppress(OSError, termios.error)
    with failures:
        port.reset_output_buffer()
    with failures:
        fcntl.ioctl(port.fileno(), termios.TIOCNXCL)
    with failures:
        port.close()


def _shut_unused(opening: Future[serial.Serial]) -> None:
    if opening.exception() is None:
        _shut(opening.result())


def check_baud(descriptor: int, baud: int) -> None:
    """Check on Linux that a device has taken a baud rate without termios constant; `OSError` if not."""
    speed_in, speed_out = SPEEDS.unpack(fcntl.ioctl(descriptor, TCGETS2, bytes(SPEEDS.size)))
    if (speed_in, speed_out) != (baud, baud):
        raise OSError(f"asked for {baud} baud, the device took {speed_out}")
