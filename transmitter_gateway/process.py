"""The transmitter gateway process: commands and poses in, serial frames out."""

import logging
import math
import signal
import sys
import traceback
from collections.abc import Callable, Iterable
from functools import partial

from rcopterx.bus import channels
from rcopterx.bus.heartbeat import Heartbeat, own_heartbeat
from rcopterx.bus.messages import Pose
from rcopterx.bus.realtime import prepare_loop, request_realtime
from rcopterx.bus.session import Session
from rcopterx.bus.subscription import Subscription
from rcopterx.transmitter_gateway.inputs import FLYING, Action, ActionRequest, PoseInput
from rcopterx.transmitter_gateway.kill_keys import KillKeys
from rcopterx.transmitter_gateway.recall import Recall
from rcopterx.transmitter_gateway.settings import GatewaySettings
from rcopterx.transmitter_gateway.station import Station
from rcopterx.transmitter_gateway.transmitter import Transmitter
from rcopterx.transmitter_gateway.wakeup import Wakeup

_LOG = logging.getLogger(__name__)

STATUS_PERIOD_S = 0.2
SHUTDOWN_LIMIT_S = 10.0
"""A landing from the ceiling takes most of it."""
TURN_S = 0.005
"""Longest time between two turns of the loop. Poses do not wake it: agents need the processor when a frame
has arrived, and the limits of surveillance are tenths of a second."""
POSES_KEPT = 16
"""Of one vehicle: more than arrive between two turns, also from a fast Tracker."""


class Gateway:
    """All transmitters of one process."""

    def __init__(
        self,
        settings: GatewaySettings,
        session: Session,
        wakeup: Wakeup,
        keys: KillKeys,
        realtime: bool,
        heartbeat: Heartbeat,
    ) -> None:
        self._session = session
        self._heartbeat = heartbeat
        self._wakeup = wakeup
        self._keys = keys
        self._clock = session.clock
        self.stations = {
            transmitter.vehicle: Station(transmitter, session, realtime, wakeup.notify)
            for transmitter in settings.transmitters
        }
        self._transmitters = {name: station.transmitter for name, station in self.stations.items()}
        self._poses: dict[str, Subscription[Pose]] = {
            name: session.subscribe(channels.POSE, name, depth=POSES_KEPT, waking=False)
            for name in settings.vehicles
        }
        self._kills = [
            session.subscribe(channels.KILL, channels.FLEET_UNIT, depth=4, fleet=fleet)
            for fleet in (settings.bus.fleet, channels.EVERY_FLEET)
        ]
        self._report_due_s = self._clock() + STATUS_PERIOD_S
        for transmitter in self._transmitters.values():
            transmitter.await_recall(self._clock())
        self.recall = Recall(session, self.stations)

    def wait(self) -> None:
        """Wait for a message, an answer of a module or the next deadline, at most `TURN_S`."""
        transmitters = self._transmitters.values()
        self._heartbeat.beat(_flying(transmitters))
        deadlines_s = [self._report_due_s, *(transmitter.next_deadline_s() for transmitter in transmitters)]
        timeout_s = min(TURN_S, min(deadlines_s) - self._clock())
        if any(station.commands_wait for station in self.stations.values()):
            timeout_s = 0.0
        ports = {transmitter.port.fileno(): transmitter for transmitter in transmitters}
        descriptors = [port for port in ports if port is not None]
        for descriptor in self._wakeup.wait([*descriptors, *self._keys.descriptors], timeout_s):
            if descriptor in ports:
                ports[descriptor].on_readable(self._clock())
            elif self._keys.pressed():
                self.kill("key press")

    def step(self) -> None:
        """Handle what has arrived and what is due; poses first, so that every decision knows the newest."""
        for pose, arrived_s in self._new_poses():
            for transmitter in self._transmitters.values():
                transmitter.on_pose(pose, arrived_s)
        for vehicle, last in self.recall.answers():
            self._transmitters[vehicle].recall(last, self._clock())
        for station in self.stations.values():
            station.take_bids(self._clock())
            station.take_commands(self._clock)
        for kills in self._kills:
            for kill in kills.drain():
                for station in self.stations.values():
                    station.take_kill(kill.message, self._clock())
                # The sender of a kill waits for the statuses.
                self._report_due_s = -math.inf
        for incoming in self._session.pending():
            self.stations[incoming.unit].answer(incoming, self._clock())
        for station in self.stations.values():
            station.serve(self._clock())
        self._report()

    def kill(self, by: str) -> None:
        """Cut the motors of every vehicle of this gateway, latching."""
        self._request(Action.KILL, by)

    def _request(self, action: Action, by: str) -> None:
        for transmitter in self._transmitters.values():
            transmitter.request(ActionRequest(action, by=by), self._clock())

    def shut_down(self, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Bring every vehicle down, end on throttle-low frames, close the ports; kills still count."""
        transmitters = self._transmitters.values()
        self._request(Action.SHUTDOWN, "gateway")
        limit_s = self._clock() + SHUTDOWN_LIMIT_S
        while not all(transmitter.finished for transmitter in transmitters) and self._clock() < limit_s:
            self.wait()
            self.step()
            meanwhile()
        self._close()

    def bring_down(self, kill_requested: Callable[[], bool]) -> None:
        """Bring the vehicles down after an error, without the bus; the others do not depend on a broken one.

        `kill_requested` returns whether a signal has requested a kill since its last call.
        """
        working = dict(self._transmitters)

        def request(action: Action) -> None:
            what = ActionRequest(action, by="an error in the gateway")
            _each(working, lambda transmitter: transmitter.request(what, self._clock()))

        request(Action.SHUTDOWN)
        limit_s = self._clock() + SHUTDOWN_LIMIT_S
        while not all(transmitter.finished for transmitter in working.values()) and self._clock() < limit_s:
            self._heartbeat.beat(_flying(working.values()))
            # Deadlines are not used here: their computation may be what is broken.
            pressed = self._wakeup.wait(self._keys.descriptors, TURN_S)
            if kill_requested() or (pressed and self._keys.pressed()):
                request(Action.KILL)
            self._pass_poses(working)
            _each(working, self._serve)
        self._close()

    def _pass_poses(self, working: dict[str, Transmitter]) -> None:
        """Pass new poses to the working transmitters; without poses they descend open loop."""
        try:
            poses = self._new_poses()
        except Exception:  # noqa: BLE001 - whatever is wrong with the poses, the vehicles must come down
            traceback.print_exc()
            self._poses.clear()
            return
        for pose, arrived_s in poses:
            _each(working, partial(Transmitter.on_pose, pose=pose, now_s=arrived_s))

    def _serve(self, transmitter: Transmitter) -> None:
        transmitter.on_readable(self._clock())
        transmitter.tick(self._clock())

    def _close(self) -> None:
        for transmitter in self._transmitters.values():
            transmitter.close()
        self.recall.close()

    def _new_poses(self) -> list[tuple[PoseInput, float]]:
        return [
            (pose_input(name, received.message), received.arrived_s)
            for name, poses in self._poses.items()
            for received in poses.drain()
        ]

    def _report(self) -> None:
        """Publish statuses when they are due."""
        now_s = self._clock()
        if now_s >= self._report_due_s:
            self._report_due_s = now_s + STATUS_PERIOD_S
            for station in self.stations.values():
                station.report(now_s)


def _flying(transmitters: Iterable[Transmitter]) -> bool:
    return any(transmitter.arbiter.state in FLYING for transmitter in transmitters)


def pose_input(vehicle: str, pose: Pose) -> PoseInput:
    """Raw pose of a vehicle in the form of the arbiter."""
    quaternion = pose.quaternion_xyzw
    yaw_rad = None
    if quaternion is not None:
        x, y, z, w = quaternion
        yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return PoseInput(vehicle, pose.epoch, pose.frame, pose.position_m, pose.period_s, yaw_rad, pose.latency_s)


def _each(working: dict[str, Transmitter], act: Callable[[Transmitter], object]) -> None:
    """Call `act` with every transmitter; one that fails is logged and given up."""
    for name, transmitter in list(working.items()):
        try:
            act(transmitter)
        except Exception:  # noqa: BLE001 - whatever is wrong with it, the others must come down
            traceback.print_exc()
            _LOG.error("%s: cannot be brought down", name)
            del working[name]


def run_gateway(settings: GatewaySettings) -> None:
    """Run a transmitter gateway until SIGTERM or SIGINT, then bring its vehicles down.

    SIGUSR1 and a key on the gateway's terminal kill all of them. When the bus is lost, the arbiters bring the
    vehicles down because their commands are silent; the gateway sends throttle low and serves again when the
    bus is back. Raises `BusUnreachableError` if no router answers at the start.
    """
    wakeup = Wakeup()
    caught: set[int] = set()

    def catch(number: int, _frame: object) -> None:
        caught.add(number)
        wakeup.notify()

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1):
        signal.signal(number, catch)
    realtime = request_realtime(settings.realtime_priority)
    with (
        Session(settings.bus, wake=wakeup.notify) as session,
        KillKeys(sys.stdin.fileno()) as keys,
    ):
        heartbeat = own_heartbeat()
        gateway = Gateway(settings, session, wakeup, keys, realtime, heartbeat)
        prepare_loop()
        try:
            run_until_stopped(gateway, caught)
        except BaseException:
            gateway.bring_down(lambda: _kill_requested(caught))
            raise
        finally:
            heartbeat.ending()
    wakeup.close()


def run_until_stopped(gateway: Gateway, caught: set[int]) -> None:
    """Serve until SIGTERM or SIGINT, then bring the vehicles down.

    `caught` holds the signals that have arrived; SIGUSR1 is removed when it has been obeyed.
    """
    while not caught & {signal.SIGTERM, signal.SIGINT}:
        gateway.wait()
        gateway.step()
        _obey_kill(gateway, caught)
    gateway.shut_down(lambda: _obey_kill(gateway, caught))


def _kill_requested(caught: set[int]) -> bool:
    requested = signal.SIGUSR1 in caught
    caught.discard(signal.SIGUSR1)
    return requested


def _obey_kill(gateway: Gateway, caught: set[int]) -> None:
    if _kill_requested(caught):
        gateway.kill("SIGUSR1")
