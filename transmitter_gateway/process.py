"""The transmitter gateway process: commands and poses in, serial frames out."""

import math
import signal
import time

from bus import channels
from bus.messages import Pose
from bus.realtime import request_realtime, settle
from bus.session import Session
from bus.subscription import Subscription
from transmitter_gateway.inputs import Action, PoseInput, Request
from transmitter_gateway.settings import GatewaySettings
from transmitter_gateway.station import Station
from transmitter_gateway.wakeup import Wakeup

STATUS_PERIOD_S = 0.2
LONGEST_WAIT_S = 0.1
SHUTDOWN_LIMIT_S = 5.0
POSE_PATIENCE_S = 0.005
"""How long poses wait to be judged. Agents need the processor as soon as a frame has arrived, and limits of
surveillance are counted in tenths of a second."""


class Gateway:
    """All transmitters of one process."""

    def __init__(self, settings: GatewaySettings, session: Session, wakeup: Wakeup, realtime: bool) -> None:
        self._session = session
        self._wakeup = wakeup
        self._clock = session.clock
        self._stations = {
            transmitter.vehicle: Station(transmitter, session, realtime)
            for transmitter in settings.transmitters
        }
        self._poses: dict[str, Subscription[Pose]] = {
            name: session.subscribe(channels.POSE, name, depth=8) for name in settings.vehicles
        }
        self._kill = session.subscribe(channels.KILL, channels.FLEET_UNIT, depth=4)
        self._report_at_s = 0.0

    def wait(self) -> None:
        """Wait for a message, an answer of a module or the next deadline."""
        deadline_s = min(
            self._report_at_s,
            self._poses_at_s(),
            *(station.transmitter.next_deadline_s() for station in self._stations.values()),
        )
        timeout_s = min(LONGEST_WAIT_S, deadline_s - self._clock())
        ports = {station.transmitter.port.fileno(): station for station in self._stations.values()}
        ready = self._wakeup.wait((port for port in ports if port is not None), timeout_s)
        for descriptor in ready:
            ports[descriptor].transmitter.on_readable(self._clock())

    def step(self) -> None:
        """Everything that is due now; commands first, for they are written on arrival."""
        for station in self._stations.values():
            station.take_commands(self._clock)
        for kill in self._kill.drain():
            for station in self._stations.values():
                station.take_kill(kill.message, self._clock())
        for incoming in self._session.pending():
            self._stations[incoming.unit].answer(incoming, self._clock())
        if self._clock() >= self._poses_at_s():
            for name, poses in self._poses.items():
                for pose in poses.drain():
                    self._take_pose(name, pose.message)
        for station in self._stations.values():
            station.transmitter.tick(self._clock())
            station.announce_write()
        self._report()

    def shut_down(self) -> None:
        """Bring every vehicle down, end on throttle-low frames, close the ports."""
        transmitters = [station.transmitter for station in self._stations.values()]
        for transmitter in transmitters:
            transmitter.request(Request(Action.SHUTDOWN, by="gateway"), self._clock())
        limit_s = self._clock() + SHUTDOWN_LIMIT_S
        while not all(transmitter.finished for transmitter in transmitters) and self._clock() < limit_s:
            self.wait()
            self.step()
        for transmitter in transmitters:
            transmitter.close()

    def _poses_at_s(self) -> float:
        waiting = (poses.waiting_since_s() for poses in self._poses.values())
        return min(
            (since_s + POSE_PATIENCE_S for since_s in waiting if since_s is not None), default=math.inf
        )

    def _take_pose(self, name: str, pose: Pose) -> None:
        raw = PoseInput(name, pose.epoch, pose.frame, pose.position_m, pose.period_s)
        for station in self._stations.values():
            station.take_pose(raw, self._clock())

    def _report(self) -> None:
        now_s = self._clock()
        if now_s >= self._report_at_s:
            self._report_at_s = now_s + STATUS_PERIOD_S
            for station in self._stations.values():
                station.report(now_s)


def run_gateway(settings: GatewaySettings) -> None:
    """Run a transmitter gateway until SIGTERM or SIGINT, then bring its vehicles down.

    Raises
    ------
    BusUnreachableError
        No router answers.
    """
    wakeup = Wakeup()
    stopping: list[int] = []

    def stop(number: int, _frame: object) -> None:
        stopping.append(number)
        wakeup.notify()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    realtime = request_realtime(settings.realtime_priority)
    with Session(settings.bus, wake=wakeup.notify, clock=time.monotonic) as session:
        gateway = Gateway(settings, session, wakeup, realtime)
        settle()
        try:
            while not stopping:
                gateway.wait()
                gateway.step()
        finally:
            gateway.shut_down()
    wakeup.close()
