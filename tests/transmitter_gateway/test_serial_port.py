import errno
import fcntl
import itertools
import os
import pty
import select
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from operator import call
from pathlib import Path

import pytest
import serial
from support.garbage import no_garbage
from support.waiting import wait_for

from rcopterx.radios.protocol import SerialLine
from rcopterx.transmitter_gateway import serial_port
from rcopterx.transmitter_gateway.serial_port import (
    LONGEST_BACKLOG_S,
    RETRY_S,
    SerialPort,
    WriteOutcome,
    check_baud,
    reason_of,
)

LINE = SerialLine(100_000, "N", 2)
FRAME = bytes(range(27))


class Device:
    """The other end of a pseudo-terminal reached through a symbolic link."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plug()

    def plug(self) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self.slave))

    def unplug(self) -> None:
        os.close(self.master)
        os.close(self.slave)
        self.path.unlink()

    def read(self) -> bytes:
        assert select.select([self.master], [], [], 60.0)[0]
        return os.read(self.master, 65536)


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "h1")
    yield device
    if device.path.is_symlink():
        device.unplug()


@pytest.fixture
def port(device: Device) -> Iterator[SerialPort]:
    port = SerialPort(str(device.path), LINE, call)
    assert port.service(0.0)
    yield port
    port.close()


def test_frames_arrive_whole(device: Device, port: SerialPort) -> None:
    assert port.write_frame(FRAME, 0.0) is WriteOutcome.WRITTEN
    assert device.read() == FRAME
    assert port.problem is None
    assert port.next_attempt_s == float("inf")


@pytest.mark.parametrize("baud", [100_000, 125_000, 115_200])
def test_standard_and_custom_baud_rates_are_set(device: Device, baud: int) -> None:
    port = SerialPort(str(device.path), SerialLine(baud, "N", 2), call)
    assert port.service(0.0)
    descriptor = port.fileno()
    assert descriptor is not None
    flags = fcntl.ioctl(descriptor, 0x802C542A, bytes(44))
    assert int.from_bytes(flags[40:44], "little") == baud
    assert int.from_bytes(flags[8:12], "little") & termios.CSTOPB
    port.close()


def test_a_device_that_is_no_terminal_refuses_the_baud_rate() -> None:
    with open(os.devnull, "wb") as file, pytest.raises(OSError, match="Inappropriate ioctl"):
        check_baud(file.fileno(), 100_000)


def test_answers_are_read_without_waiting(device: Device, port: SerialPort) -> None:
    assert port.read_available(0.0) == b""
    os.write(device.master, b"MP")
    assert select.select([port.fileno()], [], [], 60.0)[0]
    assert port.read_available(0.0) == b"MP"


def test_missing_device_is_said_and_tried_again(tmp_path: Path) -> None:
    path = tmp_path / "h1"
    port = SerialPort(str(path), LINE, call)
    assert not port.service(0.0)
    assert port.problem == f"cannot open {path}: there is no such device; is the adapter plugged in?"
    assert port.next_attempt_s == RETRY_S
    assert 0.1 <= RETRY_S <= 0.2
    device = Device(path)
    assert not port.service(RETRY_S - 0.01)
    assert port.service(RETRY_S)
    assert port.write_frame(FRAME, RETRY_S) is WriteOutcome.WRITTEN
    port.close()
    device.unplug()


def test_a_second_gateway_cannot_open_the_port(device: Device, port: SerialPort) -> None:
    second = SerialPort(str(device.path), LINE, call)
    assert not second.service(0.0)
    assert second.problem == f"cannot open {device.path}: another program has it"
    assert port.write_frame(FRAME, 0.0) is WriteOutcome.WRITTEN


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (serial.SerialException(errno.EBUSY, "could not open port"), "another program has it"),
        (serial.SerialException(errno.EACCES, "could not open port"), "sudo usermod -aG dialout $USER"),
        (termios.error(errno.EINVAL, "tcsetattr"), "Invalid argument"),
        (ValueError("not a baud rate"), "not a baud rate"),
    ],
)
def test_why_a_port_cannot_be_opened_is_told_in_words(error: Exception, words: str) -> None:
    assert words in reason_of(error)


def test_parity_the_device_drops_is_a_clear_problem_and_not_a_crash(device: Device) -> None:
    first = SerialPort(str(device.path), SerialLine(115_200, "E", 2), call)
    assert first.service(0.0)
    first.close()
    second = SerialPort(str(device.path), SerialLine(115_200, "E", 2), call)
    assert not second.service(0.0)
    assert second.problem is not None
    assert "Invalid argument" in second.problem


def test_closed_port_reports_frames_as_not_sent(port: SerialPort) -> None:
    port.close()
    assert port.fileno() is None
    assert port.write_frame(FRAME, 0.0) is WriteOutcome.CLOSED
    assert port.read_available(0.0) == b""
    assert port.problem == "closed"


def test_unplugging_during_writes_loses_the_port_and_closes_the_descriptor(
    device: Device, port: SerialPort
) -> None:
    descriptor = port.fileno()
    assert descriptor is not None
    device.unplug()
    assert port.write_frame(FRAME, 1.0) is WriteOutcome.FAILED
    assert not port.is_open
    assert port.counters["losses"] == 1
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)
    assert port.next_attempt_s == 1.0 + RETRY_S


def test_unplugging_is_noticed_by_reading_too(device: Device, port: SerialPort) -> None:
    device.unplug()
    assert port.read_available(1.0) == b""
    assert not port.is_open
    assert port.problem is not None
    assert str(device.path) in port.problem


def test_failed_read_loses_the_port_and_says_why(
    device: Device, port: SerialPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(descriptor: int, size: int) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    os.write(device.master, b"MP")
    assert select.select([port.fileno()], [], [], 60.0)[0]
    with monkeypatch.context() as patch:
        patch.setattr(os, "read", fail)
        assert port.read_available(1.0) == b""
    assert port.problem == f"read from {device.path} failed: [Errno 5] Input/output error"
    assert port.next_attempt_s == 1.0 + RETRY_S


def test_device_that_does_not_open_keeps_no_process_from_ending() -> None:
    started: list[threading.Thread] = []
    released = threading.Event()

    def work() -> None:
        started.append(threading.current_thread())
        released.wait(60.0)

    serial_port.in_thread(work)
    wait_for(lambda: started, "no thread")
    released.set()
    assert started[0].daemon
    assert started[0] is not threading.current_thread()


def test_port_is_reopened_through_the_symbolic_link_of_the_new_device(
    device: Device, port: SerialPort
) -> None:
    device.unplug()
    port.write_frame(FRAME, 1.0)
    device.plug()
    assert not port.service(1.1)
    assert port.service(1.0 + RETRY_S)
    assert port.write_frame(FRAME, 1.2) is WriteOutcome.WRITTEN
    assert device.read() == FRAME
    assert port.counters["openings"] == 2


def fill(port: SerialPort, now_s: float) -> WriteOutcome:
    """Write until the kernel takes no whole frame any more."""
    outcome = WriteOutcome.WRITTEN
    for _ in range(10_000):
        outcome = port.write_frame(FRAME, now_s)
        if outcome is not WriteOutcome.WRITTEN:
            break
    return outcome


def test_slow_reader_gets_no_fragment_extended_and_the_port_is_given_up(
    port: SerialPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int, data: bytes) -> int:
        raise BlockingIOError(errno.EAGAIN, "full")

    outcome = fill(port, 0.0)
    assert outcome in (WriteOutcome.SHORT, WriteOutcome.BACKLOG)
    if outcome is WriteOutcome.SHORT:
        assert port.write_frame(FRAME, 0.0019) is WriteOutcome.SILENT
    # The kernel moves what it has taken in a thread of its own, and would then take a little more.
    monkeypatch.setattr(os, "write", refuse)
    now_s = 0.01
    while port.is_open and now_s < 1.0:
        assert port.write_frame(FRAME, now_s) is WriteOutcome.BACKLOG
        now_s += 0.02
    assert not port.is_open
    assert now_s < LONGEST_BACKLOG_S + 0.06
    assert port.problem is not None
    assert "takes no bytes" in port.problem


def test_short_write_is_followed_by_silence(port: SerialPort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "write", lambda descriptor, data: len(data) - 1)
    assert port.write_frame(FRAME, 1.0) is WriteOutcome.SHORT
    monkeypatch.undo()
    assert port.write_frame(FRAME, 1.0015) is WriteOutcome.SILENT
    assert port.write_frame(FRAME, 1.0021) is WriteOutcome.WRITTEN
    assert port.counters[WriteOutcome.SHORT] == 1


def test_queued_bytes_drop_frames_so_that_no_stale_burst_builds_up(
    port: SerialPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    queued = 28
    monkeypatch.setattr(serial.Serial, "out_waiting", property(lambda _: queued))
    assert port.write_frame(FRAME, 0.0) is WriteOutcome.BACKLOG
    queued = 27
    assert port.write_frame(FRAME, 0.02) is WriteOutcome.WRITTEN
    queued = 100
    assert port.write_frame(FRAME, 0.04) is WriteOutcome.BACKLOG
    assert port.write_frame(FRAME, 0.13) is WriteOutcome.BACKLOG
    assert port.is_open
    assert port.write_frame(FRAME, 0.15) is WriteOutcome.BACKLOG
    assert not port.is_open
    assert port.next_attempt_s == 0.15 + RETRY_S


def test_bytes_that_nobody_has_read_from_a_terminal_are_not_queued_in_it(port: SerialPort) -> None:
    for number in range(3):
        assert port.write_frame(FRAME, 0.02 * number) is WriteOutcome.WRITTEN


def test_closing_lets_another_user_open_the_port(device: Device, port: SerialPort) -> None:
    port.close()
    second = SerialPort(str(device.path), LINE, call)
    assert second.service(0.0)
    second.close()


def blocking(monkeypatch: pytest.MonkeyPatch, device: Device, name: str) -> threading.Event:
    """Let a call of the library for a device block until the event is set.

    Collected ports of other tests are closed, too.
    """
    released = threading.Event()
    real = getattr(serial.Serial, name)

    def blocked(port: serial.Serial) -> None:
        assert port.port != str(device.path) or released.wait(60.0)
        real(port)

    monkeypatch.setattr(serial.Serial, name, blocked)
    return released


def test_opening_that_blocks_keeps_nothing_waiting_and_is_used_when_it_has_ended(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    released = blocking(monkeypatch, device, "open")
    port = SerialPort(str(device.path), LINE)
    assert not port.service(0.0)
    assert port.is_opening
    assert port.write_frame(FRAME, 0.5) is WriteOutcome.CLOSED
    assert not port.service(0.9)
    assert port.problem == "not opened yet"
    assert not port.service(1.1)
    assert port.problem == f"{device.path} does not open; unplug the adapter"
    assert port.next_attempt_s == float("inf")
    released.set()
    wait_for(lambda: not port.is_opening, "it does not open")
    assert port.next_attempt_s == float("-inf")
    assert port.service(1.2)
    assert not port.service(1.2)
    assert port.write_frame(FRAME, 1.2) is WriteOutcome.WRITTEN
    assert device.read() == FRAME
    port.close()


def test_device_that_opens_after_its_port_was_closed_is_left_to_others(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    released = blocking(monkeypatch, device, "open")
    port = SerialPort(str(device.path), LINE)
    port.service(0.0)
    port.close()
    released.set()
    second = SerialPort(str(device.path), LINE, call)
    now_s = itertools.count(step=RETRY_S)
    wait_for(lambda: second.service(next(now_s)), "another program has it")
    second.close()


def test_closing_that_blocks_keeps_nothing_waiting(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    released = blocking(monkeypatch, device, "close")
    port = SerialPort(str(device.path), LINE)
    wait_for(lambda: port.service(time.monotonic()), "it does not open")
    device.unplug()
    assert port.write_frame(FRAME, time.monotonic()) is WriteOutcome.FAILED
    assert not port.is_open
    device.plug()
    # A device under the old name can still be locked by the thread that closes its predecessor.
    wait_for(lambda: port.service(time.monotonic()), "it does not open again")
    assert port.write_frame(FRAME, time.monotonic()) is WriteOutcome.WRITTEN
    port.close()
    released.set()


def test_system_without_another_thread_is_a_problem_and_keeps_no_port_open(device: Device) -> None:
    def refuse(work: Callable[[], None]) -> None:
        if exhausted:
            raise RuntimeError("can't start new thread")
        work()

    exhausted = True
    port = SerialPort(str(device.path), LINE, refuse)
    assert not port.service(0.0)
    assert port.problem == f"cannot open {device.path}: can't start new thread"
    exhausted = False
    assert port.service(RETRY_S)
    descriptor = port.fileno()
    assert descriptor is not None
    exhausted = True
    port.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)


def test_a_device_that_is_missing_leaves_no_reference_cycles(tmp_path: Path) -> None:
    port = SerialPort(str(tmp_path / "missing"), LINE, call)
    with no_garbage():
        for turn in range(100):
            assert not port.service(2 * turn * RETRY_S)
