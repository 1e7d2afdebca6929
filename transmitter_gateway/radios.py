"""All transmitters of a gateway process, served with or without the bus."""

import logging
import signal
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from rcopterx.background import at_once, in_thread
from rcopterx.bus.clock import REAL_TIME, Clock
from rcopterx.bus.heartbeat import Heartbeat
from rcopterx.bus.wakeup import Wakeup
from rcopterx.radios.crazyradio import RADIO, UsbDevice, find_dongle
from rcopterx.radios.udp import UDP
from rcopterx.transmitter_gateway.inputs import FLYING, Action, ActionRequest, PoseInput
from rcopterx.transmitter_gateway.journal import Journal
from rcopterx.transmitter_gateway.kill_keys import KillKeys
from rcopterx.transmitter_gateway.port import Port
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings
from rcopterx.transmitter_gateway.state_page import StatePage, open_page, page_of_process
from rcopterx.transmitter_gateway.transmitter import Transmitter


def port_for(
    settings: TransmitterSettings, clock: Clock = REAL_TIME, dongles: Callable[[int], UsbDevice] = find_dongle
) -> Port:
    """Return a port for a transmitter, not yet opened; `dongles` finds Crazyradios by their number."""
    start = at_once if clock.lockstep else in_thread
    if settings.port.startswith(UDP):
        # Imported here and below: most gateways have serial ports only.
        from rcopterx.radios.set_points import SetPointRadio
        from rcopterx.transmitter_gateway.udp_port import UdpPort

        if isinstance(settings.protocol, SetPointRadio):
            return UdpPort(settings.port, settings.protocol, start)
    if settings.port.startswith(RADIO):
        from rcopterx.radios.crtp import RadioAddress
        from rcopterx.transmitter_gateway.crazyradio import CrazyradioPort, crazyradio

        address = RadioAddress.of(settings.port)
        return CrazyradioPort(settings.port, address, crazyradio(address.dongle, dongles, clock))
    return SerialPort(settings.port, settings.protocol.line, start)


_LOG = logging.getLogger(__name__)

TURN_S = 0.005
"""Longest time between two turns of the loop. Poses do not wake it: agents need the processor when a frame
has arrived, and the limits of surveillance are tenths of a second."""
COMMANDED_TURN_S = 0.02  # the same while commands fly all vehicles: each is judged with poses there


class Radios:
    """The transmitters by vehicle; each continues from what an earlier process wrote last.

    A kill key, or SIGUSR1 in the `caught` signals, kills all vehicles; it is removed then.
    """

    def __init__(
        self,
        settings: GatewaySettings,
        wakeup: Wakeup,
        keys: KillKeys,
        caught: set[int],
        heartbeat: Heartbeat,
        clock: Callable[[], float],
    ) -> None:
        self._wakeup, self._keys, self._caught, self._heartbeat = wakeup, keys, caught, heartbeat
        self._clock, self.journal = clock, Journal(clock())
        self.transmitters = {
            each.vehicle: Transmitter(
                each, port_for(each, settings.bus.clock, settings.dongles), self.journal
            )
            for each in settings.transmitters
        }
        self._pages = {name: _page(settings.states / name) for name in self.transmitters}
        for name, page in self._pages.items():
            self.transmitters[name].resume(page, clock())

    def wait(self, due_s: float) -> None:
        """Wait for a message, an answer of a module, a deadline or `due_s`, at most a turn."""
        transmitters = self.transmitters.values()
        self._heartbeat.beat(_flying(transmitters))
        deadlines_s = [due_s, *(transmitter.next_deadline_s() for transmitter in transmitters)]
        ports = {transmitter.port.fileno(): transmitter for transmitter in transmitters}
        descriptors = [port for port in ports if port is not None]
        turn_s = COMMANDED_TURN_S if all(each.output.commanded for each in transmitters) else TURN_S
        timeout_s = min(turn_s, min(deadlines_s) - self._clock())
        sources = [self._wakeup.event, *descriptors, *self._keys.descriptors]
        for descriptor in self._wakeup.wait(timeout_s, sources):
            if descriptor in ports:
                ports[descriptor].on_readable(self._clock())
            elif self._keys.pressed():
                self.request(Action.KILL, "key press")
        if self._signalled():
            self.request(Action.KILL, "SIGUSR1")

    def _signalled(self) -> bool:
        """Whether a signal requests a kill; True once."""
        signalled = signal.SIGUSR1 in self._caught
        self._caught.discard(signal.SIGUSR1)
        return signalled

    def request(self, action: Action, by: str) -> None:
        """Carry out a request for every vehicle."""
        for transmitter in self.transmitters.values():
            transmitter.request(ActionRequest(action, by=by), self._clock())

    def serve(self) -> None:
        """Do what is due, without the bus."""
        for transmitter in self.transmitters.values():
            if self._clock() >= transmitter.next_deadline_s():
                transmitter.tick(self._clock())

    @property
    def longest_shutdown_s(self) -> float:
        """Longest time from the request to shut down until no vehicle flies any more."""
        return max(each.arbiter.limits.longest_shutdown_s for each in self.transmitters.values())

    def bring_down(self, new_poses: Callable[[], Iterable[tuple[PoseInput, float]]]) -> None:
        """Bring the vehicles down after an error; the others do not depend on a broken one.

        `new_poses` are those since the last call; if it raises, vehicles descend open loop.
        """
        working = dict(self.transmitters)

        def request(action: Action) -> None:
            what = ActionRequest(action, by="an error in the gateway")
            _each(working, lambda transmitter: transmitter.request(what, self._clock()))

        request(Action.SHUTDOWN)
        limit_s = self._clock() + self.longest_shutdown_s
        seeing = True
        while not all(transmitter.finished for transmitter in working.values()) and self._clock() < limit_s:
            self._heartbeat.beat(_flying(working.values()))
            # Deadlines are not used here: their computation may be what is broken.
            pressed = self._wakeup.wait(TURN_S, [self._wakeup.event, *self._keys.descriptors])
            if self._signalled() or (pressed and self._keys.pressed()):
                request(Action.KILL)
            seeing = seeing and self._pass_poses(working, new_poses)
            _each(working, self._read_and_write)

    def _pass_poses(
        self, working: dict[str, Transmitter], new_poses: Callable[[], Iterable[tuple[PoseInput, float]]]
    ) -> bool:
        """Pass new poses to the working transmitters; return whether that is possible."""
        try:
            poses = list(new_poses())
        except Exception:  # noqa: BLE001 - whatever is wrong with the poses, the vehicles must come down
            _LOG.exception("poses cannot be read")
            return False
        for pose, arrived_s in poses:
            _each(working, partial(Transmitter.on_pose, pose=pose, now_s=arrived_s))
        return True

    def _read_and_write(self, transmitter: Transmitter) -> None:
        transmitter.on_readable(self._clock())
        transmitter.tick(self._clock())

    def close(self) -> None:
        """Close ports and pages."""
        for transmitter in self.transmitters.values():
            transmitter.port.close()
        for page in self._pages.values():
            page.close()


def _page(path: Path) -> StatePage:
    try:
        return open_page(path)
    except OSError as error:
        _LOG.error("%s: a successor of this process will not know the state: %s", path.name, error)
        return page_of_process()


def _flying(transmitters: Iterable[Transmitter]) -> bool:
    return any(transmitter.arbiter.state in FLYING for transmitter in transmitters)


def _each(working: dict[str, Transmitter], act: Callable[[Transmitter], object]) -> None:
    """Call `act` with every transmitter; one that fails is logged and given up."""
    for name, transmitter in list(working.items()):
        try:
            act(transmitter)
        except Exception:  # noqa: BLE001 - whatever is wrong with it, the others must come down
            _LOG.exception("%s: cannot be brought down", name)
            del working[name]
