"""Crazyradio dongles on USB (protocol: Crazyradio, USB and radio protocol): several vehicles on each.

A transfer takes milliseconds, so that a thread for each dongle does them; ports exchange packets with it.
"""

import os
from collections import deque
from collections.abc import Callable
from functools import cache
from threading import Condition, RLock, Thread
from typing import Final

from rcopterx.bus.clock import REAL_TIME, Clock
from rcopterx.radios import crazyradio as usb
from rcopterx.radios.crtp import EMERGENCY_STOP, RadioAddress, joined, separated
from rcopterx.transmitter_gateway.port import Port, WriteOutcome

RETRY_S: Final = 0.3
SERVICE_S: Final = 0.02
MOST_ANSWERS: Final = 64
PACKETS_PER_S: Final = 60
"""What each vehicle needs in flight: 50 set points, and two requests with every tenth of them."""
STOP: Final = EMERGENCY_STOP.to_bytes()
TIMED: Final = 200  # newest packets whose duration is averaged


class Crazyradio:
    """A dongle, opened by `find`, and the ports of its vehicles; `problem` is why it is not open.

    With `at_once` there is no thread: packets are exchanged while a port hands them over.
    """

    def __init__(
        self,
        find: Callable[[], usb.UsbDevice],
        now: Callable[[], float] = REAL_TIME.now,
        *,
        at_once: bool = False,
    ) -> None:
        self.problem: str | None = "not opened yet"
        self._find, self._now, self._at_once = find, now, at_once
        self._ports: list[CrazyradioPort] = []
        self._changed = Condition()
        self._thread: Thread | None = None
        self._device: usb.UsbDevice | None = None
        self._tuned: RadioAddress | None = None
        self._taken_s: deque[float] = deque(maxlen=TIMED)  # by the newest packets

    @property
    def overload(self) -> str | None:
        """Why it cannot carry the packets of all its vehicles in flight, as timed; None if it can."""
        taken_s = list(self._taken_s)
        vehicles, needed = len(self._ports), PACKETS_PER_S * len(self._ports)
        if len(taken_s) < TIMED or len(taken_s) >= needed * sum(taken_s):
            return None
        carried = len(taken_s) / sum(taken_s)
        return f"this Crazyradio carries {carried:.0f} packets/s, {vehicles} vehicles need {needed}: use more"

    def attach(self, port: "CrazyradioPort") -> None:
        """Serve a port from now on."""
        with self._changed:
            if port not in self._ports:
                self._ports = [*self._ports, port]
            if self._at_once:
                if self.problem is not None:
                    self._attempt(self._open)
            elif self._thread is None:
                self._thread = Thread(target=self._run, name="crazyradio", daemon=True)
                self._thread.start()

    def detach(self, port: "CrazyradioPort") -> None:
        """Serve a port no more; without any the dongle is free for others."""
        with self._changed:
            self._ports = [other for other in self._ports if other is not port]
            self._changed.notify()

    def notify(self) -> None:
        """Begin with what a port has to send."""
        if self._at_once:
            self._attempt(self._exchange_all)
            return
        with self._changed:
            self._changed.notify()

    def _attempt(self, work: Callable[[], None]) -> None:
        """Use the dongle, and note why it fails."""
        try:
            work()
        except OSError as error:
            self.problem = f"Crazyradio: {error.strerror or error}"

    def _run(self) -> None:
        """Open the dongle, serve ports until it fails, and begin again, while there are ports."""
        while True:
            self._attempt(self._serve)
            with self._changed:
                if not self._ports:
                    self.problem, self._thread = "closed", None
                    return
                self._changed.wait(RETRY_S)

    def _open(self) -> None:
        self._device = device = self._find()
        device.ctrl_transfer(usb.TO_DEVICE, usb.SET_POWER, usb.FULL_POWER, 0, None)
        device.ctrl_transfer(usb.TO_DEVICE, usb.SET_RETRIES, usb.RETRIES, 0, None)
        self._tuned, self.problem = None, None

    def _serve(self) -> None:
        self._open()
        while self._ports:
            self._exchange_all()
            with self._changed:
                if not any(port.waiting for port in self._ports):
                    self._changed.wait(SERVICE_S)

    def _exchange_all(self) -> None:
        """Send what waits, in turn one packet each: no vehicle waits for the whole frame of another."""
        assert self._device is not None
        while [port for port in self._ports if self._exchange(self._device, port)]:
            pass

    def _exchange(self, device: usb.UsbDevice, port: "CrazyradioPort") -> bool:
        """Send one packet of a port, and pass on what the vehicle answers."""
        packet = port.next_packet()
        if packet is None:
            return False
        began_s = self._now()
        self._tune(device, port.address)
        device.write(usb.OUT, packet, usb.TIMEOUT_MS)
        status, *answer = device.read(usb.IN, usb.LONGEST_ANSWER, usb.TIMEOUT_MS) or [0]
        self._taken_s.append(self._now() - began_s)
        port.deliver(status, bytes(answer))
        return True

    def _tune(self, device: usb.UsbDevice, wanted: RadioAddress) -> None:
        tuned = self._tuned
        self._tuned = None
        if tuned is None or tuned.channel != wanted.channel:
            device.ctrl_transfer(usb.TO_DEVICE, usb.SET_CHANNEL, wanted.channel, 0, None)
        if tuned is None or tuned.rate != wanted.rate:
            device.ctrl_transfer(usb.TO_DEVICE, usb.SET_RATE, wanted.rate, 0, None)
        if tuned is None or tuned.address != wanted.address:
            device.ctrl_transfer(usb.TO_DEVICE, usb.SET_ADDRESS, 0, 0, wanted.address)
        self._tuned = wanted


@cache
def crazyradio(number: int, find: Callable[[int], usb.UsbDevice], clock: Clock) -> Crazyradio:
    """Return the dongle that all ports of this process with this number share."""
    return Crazyradio(lambda: find(number), clock.now, at_once=clock.lockstep)


class CrazyradioPort(Port):
    """One vehicle on an open dongle; counters of acknowledged, lost and repeated packets."""

    def __init__(self, path: str, address: RadioAddress, dongle: Crazyradio) -> None:
        super().__init__(path)
        self.address = address
        self._dongle = dongle
        self._lock = RLock()
        self._packets: deque[bytes] = deque()
        self._answers: deque[bytes] = deque(maxlen=MOST_ANSWERS)
        self._event: int | None = None

    def fileno(self) -> int | None:
        """See `Port`."""
        return self._event

    def service(self, now_s: float) -> bool:
        """See `Port`."""
        if self._usable() or now_s < self._next_attempt_s:
            return False
        self._next_attempt_s = now_s + SERVICE_S
        self._dongle.attach(self)
        self.problem = self._dongle.problem
        if self.problem is not None:
            return False
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self.counters["openings"] += 1
        return True

    def _usable(self) -> bool:
        """Whether the port is open; close it if its dongle has gone."""
        if self.is_open and self._dongle.problem is not None:
            self.counters["losses"] += 1
            self._release(self._dongle.problem)
        return self.is_open

    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:  # noqa: ARG002 - the interface gives it
        """Hand a frame to the dongle, unless packets of the last one still wait; a stop replaces these."""
        with self._lock:
            if not self._usable():
                return WriteOutcome.CLOSED
            if (packets := separated(frame))[0] == STOP:
                self._packets.clear()
            if self._packets:
                return WriteOutcome.BACKLOG
            self._packets.extend(packets)
        self._dongle.notify()
        return WriteOutcome.WRITTEN

    @property
    def overload(self) -> str | None:
        """See `Port`."""
        return self._dongle.overload

    @property
    def waiting(self) -> bool:
        """Whether packets wait for the dongle."""
        return bool(self._packets)

    def next_packet(self) -> bytes | None:
        """Take the next packet to send."""
        with self._lock:
            return self._packets.popleft() if self._packets else None

    def deliver(self, status: int, answer: bytes) -> None:
        """Take the dongle's status of a packet and the vehicle's answer to it."""
        acknowledged = bool(status & usb.ACKNOWLEDGED)
        with self._lock:
            self.counters["packets repeated"] += status >> 4
            self.counters["packets acknowledged" if acknowledged else "packets not acknowledged"] += 1
            if acknowledged and answer and self._event is not None:
                self._answers.append(answer)
                os.eventfd_write(self._event, 1)

    def read_available(self, now_s: float) -> bytes:  # noqa: ARG002 - the interface gives the time
        """Return the packets that have arrived, as a frame."""
        with self._lock:
            if self._event is not None and self._answers:
                os.eventfd_read(self._event)
            answers = list(self._answers)
            self._answers.clear()
        return joined(answers)

    def close(self) -> None:
        """See `Port`."""
        self._dongle.detach(self)
        self._release("closed")

    def _release(self, problem: str) -> None:
        with self._lock:
            event, self._event = self._event, None
            self._packets.clear()
            self._answers.clear()
        if event is not None:
            os.close(event)
        self.problem = problem
