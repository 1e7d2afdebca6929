"""One transmitter without bus, agents and arming: binding, range check and calibration at the workbench.

A serial port is opened exclusively; where the port is the address of a vehicle, the caller has to ensure
that no gateway serves it.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

from rcopterx.transmitter_gateway.binding import AFTER_BIND_S, LONGEST_BIND_S, POWER_UP_LIMIT_S
from rcopterx.transmitter_gateway.inputs import Answer
from rcopterx.transmitter_gateway.radios import port_for
from rcopterx.transmitter_gateway.serial_port import IN_USE
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.transmitter import Transmitter

FAREWELL_S = 0.8  # at least 25 frames of any radio

LONGEST_BINDING_S = POWER_UP_LIMIT_S + LONGEST_BIND_S + AFTER_BIND_S


class WorkbenchError(RuntimeError):
    """A request cannot be carried out; nothing was changed."""


class Workbench(AbstractContextManager["Workbench"]):
    """A transmitter that can never be armed; `wait(descriptors, timeout_s)` returns the ready ones."""

    def __init__(
        self,
        settings: TransmitterSettings,
        clock: Callable[[], float],
        wait: Callable[[Sequence[int], float], Sequence[int]],
    ) -> None:
        self.vehicle = settings.vehicle
        self._clock = clock
        self._wait = wait
        self.transmitter = Transmitter(settings, port_for(settings))

    def __exit__(self, *_: object) -> None:
        self.transmitter.show(None)
        self.transmitter.range_check(False)
        if self.transmitter.port.is_open:
            self.run(FAREWELL_S)
        self.transmitter.port.close()

    def run(
        self, seconds: float, until: Callable[[], bool] = lambda: False, descriptors: Sequence[int] = ()
    ) -> bool:
        """Serve the radio for some seconds or until `until` is true, returned; `descriptors` end pauses."""
        end_s = self._clock() + seconds
        while not until():
            now_s = self._clock()
            if now_s >= end_s:
                return False
            port = self.transmitter.port.fileno()
            waited = [*descriptors] if port is None else [port, *descriptors]
            due_s = min(end_s, self.transmitter.next_deadline_s(), now_s + 0.1)
            if port in self._wait(waited, max(0.0, due_s - now_s)):
                self.transmitter.on_readable(self._clock())
            self.transmitter.tick(self._clock())
        return True

    def wait_ready(self, limit_s: float = 5.0) -> str:
        """Wait until the module is ready and return its text, or raise `WorkbenchError`."""
        if not self.run(limit_s, self._ready):
            problem = self.transmitter.link(self._clock()).text
            hint = "; if it is a gateway, land the fleet and stop it first" if IN_USE in problem else ""
            raise WorkbenchError(f"{self.vehicle}: {problem}{hint}")
        return self.transmitter.protocol.status(self._clock()).text

    def _ready(self) -> bool:
        now_s, transmitter = self._clock(), self.transmitter
        module = transmitter.protocol.status(now_s)
        return transmitter.port.is_open and module.ready and not transmitter.busy(now_s)

    def bind(self) -> None:
        """Bind: flagged frames until the module is done, then the neutral frames receivers store as failsafe.

        A board that reads the flag only when it is switched on has to be switched on within the time. Raises
        `WorkbenchError` if the radio is bound by itself, or the port is closed.
        """
        self.run(1.0, lambda: self.transmitter.port.is_open)
        self._require(self.transmitter.bind(self._clock()))
        self.run(LONGEST_BINDING_S, lambda: not self.transmitter.busy(self._clock()))

    def range_check(self, seconds: float, until: Callable[[], bool], descriptors: Sequence[int] = ()) -> None:
        """Move the swash plate at reduced power, to show the reception; `WorkbenchError` if there is none."""
        self._require(self.transmitter.range_check(True))
        end_s = self._clock() + seconds
        pitch = 0.5
        while self._clock() < end_s:
            self.show((pitch, 0.0, 0.0, 0.0), seconds=1.0)
            pitch = -pitch
            if self.run(min(0.5, end_s - self._clock()), until, descriptors):
                return

    def show(self, u: Sequence[float], *, throttle_us: float | None = None, seconds: float) -> None:
        """Send inputs for some seconds, throttle low or at a pulse width; `WorkbenchError` if refused."""
        self._require(self.transmitter.show(u, throttle_us=throttle_us, until_s=self._clock() + seconds))

    def _require(self, answer: Answer) -> None:
        if not answer.accepted:
            raise WorkbenchError(f"{self.vehicle}: {answer.reason}")
