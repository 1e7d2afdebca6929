"""The transmitter gateway process: commands and poses in, serial frames out."""

import logging
import math
import signal
import sys
import traceback
from collections import deque
from collections.abc import Callable
from functools import partial

from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, Heartbeat, own_heartbeat
from rcopterx.bus.messages import Pose
from rcopterx.bus.realtime import request_realtime, settle
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
BRING_DOWN_PERIOD_S = 0.005
POSE_PATIENCE_S = 0.005
"""How long poses wait that decide what vehicles do. Agents need the processor as soon as a frame has arrived,
and limits of surveillance are counted in tenths of a second."""
LONGEST_POSE_WAIT_S = 0.025
"""How long the other poses wait, which are looked at when commands arrive: longer than a control period."""
TELL_SHARE = 0.2
"""Of a frame's period that the first command that was written waits to be told until the others are, too."""
HELD_S = 0.05
"""Between two times at which what was written as commanded is told: at 50 Hz three writes go out together."""
LONGEST_HELD_S = 0.08
"""The same where nothing is written any more."""
POSES_KEPT = 16
"""Of one vehicle: more than arrive meanwhile, also from a fast Tracker."""


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
        self._called: deque[Station] = deque()
        self._stations = {
            transmitter.vehicle: Station(transmitter, session, realtime, self._call)
            for transmitter in settings.transmitters
        }
        self._judge_poses_at_s = math.inf
        self._poses_wake = True
        self._poses_arrived = False
        self._poses_taken_s = -math.inf
        self._stations_due_s = -math.inf
        self._tell_by_s = math.inf
        self._told_s = -math.inf
        self._period_s = 0.0
        self._flying = False
        self._poses: dict[str, Subscription[Pose]] = {
            name: session.subscribe(channels.POSE, name, depth=POSES_KEPT, wake=self._on_pose)
            for name in settings.vehicles
        }
        self._kills = [
            session.subscribe(channels.KILL, channels.FLEET_UNIT, depth=4, fleet=fleet)
            for fleet in (settings.bus.fleet, channels.EVERY_FLEET)
        ]
        self._report_due_s = self._clock() + STATUS_PERIOD_S
        for station in self._stations.values():
            station.transmitter.await_recall(self._clock())
        self._recall = Recall(session, self._stations)

    def wait(self) -> None:
        """Wait for a message, an answer of a module or the next deadline."""
        self._heartbeat.beat(self._flying)
        deadline_s = min(
            self._report_due_s,
            self._tell_by_s,
            self._judge_poses_at_s,
            self._poses_taken_s + LONGEST_POSE_WAIT_S,
            self._stations_due_s,
        )
        timeout_s = 0.0 if self._called else min(LONGEST_WAIT_S, deadline_s - self._clock())
        ports = {station.transmitter.port.fileno(): station for station in self._stations.values()}
        descriptors = [port for port in ports if port is not None]
        for descriptor in self._wakeup.wait([*descriptors, *self._keys.descriptors], timeout_s):
            if descriptor in ports:
                ports[descriptor].transmitter.on_readable(self._clock())
            elif self._keys.pressed():
                self.kill("key press")

    def step(self) -> None:
        """Everything that is due now: poses first, so that nobody decides about a vehicle unseen."""
        if not self._poses_may_wait():
            self._take_poses()
        for vehicle, last in self._recall.answers():
            self._stations[vehicle].transmitter.recall(last, self._clock())
            self._called.append(self._stations[vehicle])
        if self._called:
            self._serve_called()
        for kills in self._kills:
            for kill in kills.drain():
                for station in self._stations.values():
                    station.take_kill(kill.message, self._clock())
                # Whoever killed waits for this.
                self._report_due_s = -math.inf
        for incoming in self._session.pending():
            self._stations[incoming.unit].answer(incoming, self._clock())
        self._look_at_stations()
        self._report()

    def _serve_called(self) -> None:
        """Take bids and commands of the stations that have some."""
        called = dict.fromkeys([self._called.popleft() for _ in range(len(self._called))])
        for station in called:
            station.take_bids(self._clock())
            station.take_commands(self._clock)
            if station.commands_wait:
                self._called.append(station)
        for station in called:
            station.tell_lease()

    def _look_at_stations(self) -> None:
        """Let stations do what is due, and note what the next wait has to know of them."""
        due_s, flying, poses_wake, complete = math.inf, False, False, True
        untold: list[Station] = []
        for station in self._stations.values():
            now_s, transmitter = self._clock(), station.transmitter
            if now_s >= transmitter.due_s:
                station.look(now_s)
            if transmitter.due_s < due_s:
                due_s = transmitter.due_s
            if station.untold:
                untold.append(station)
            elif station.flies:
                complete = False
            flying = flying or station.flies
            poses_wake = poses_wake or station.acts_on_poses
        self._stations_due_s, self._flying, self._poses_wake = due_s, flying, poses_wake
        self._tell_writes(untold, complete)

    def _tell_writes(self, untold: list[Station], complete: bool) -> None:
        """Publish what these have written, when all that fly have, or the first one has waited enough.

        Nobody needs it before the next frame, and several programs of each host take it in: nobody's command
        waits for that, and messages that go out together share packets. What agents know already is kept back
        for longer for the same reason.
        """
        if not untold:
            self._tell_by_s = math.inf
            return
        now_s = self._clock()
        held_enough = now_s >= self._told_s + HELD_S
        due = untold if held_enough or now_s >= self._tell_by_s else [one for one in untold if one.has_news]
        if due and not complete and now_s < self._tell_by_s:
            self._tell_by_s = min(self._tell_by_s, now_s + TELL_SHARE * self._period_s)
            return
        for station in due:
            station.publish_writes()
        if len(due) == len(untold):
            self._told_s, self._tell_by_s = now_s, math.inf
        else:
            self._tell_by_s = self._told_s + LONGEST_HELD_S

    def kill(self, by: str) -> None:
        """Cut the motors of every vehicle of this gateway, latching."""
        self._request(Action.KILL, by)

    def _request(self, action: Action, by: str) -> None:
        """Ask something of every transmitter; the next wait is over at once."""
        for station in self._stations.values():
            station.transmitter.request(ActionRequest(action, by=by), self._clock())
        self._stations_due_s = -math.inf

    def shut_down(self, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Bring every vehicle down, end on throttle-low frames, close the ports; kills still count."""
        transmitters = [station.transmitter for station in self._stations.values()]
        self._request(Action.SHUTDOWN, "gateway")
        limit_s = self._clock() + SHUTDOWN_LIMIT_S
        while not all(transmitter.finished for transmitter in transmitters) and self._clock() < limit_s:
            self.wait()
            self.step()
            meanwhile()
        for station in self._stations.values():
            station.publish_writes()
        for transmitter in transmitters:
            transmitter.close()
        self._recall.close()

    def bring_down(self, kill_asked: Callable[[], bool]) -> None:
        """After an error: as `shut_down`, without telling anybody; what is broken does not stop the others.

        Parameters
        ----------
        kill_asked
            Whether a signal has asked for a kill since the last call.
        """
        working = {name: station.transmitter for name, station in self._stations.items()}

        def ask(action: Action) -> None:
            request = ActionRequest(action, by="an error in the gateway")
            _each(working, lambda transmitter: transmitter.request(request, self._clock()))

        ask(Action.SHUTDOWN)
        limit_s = self._clock() + SHUTDOWN_LIMIT_S
        while not all(transmitter.finished for transmitter in working.values()) and self._clock() < limit_s:
            self._heartbeat.beat(any(transmitter.arbiter.state in FLYING for transmitter in working.values()))
            # What is due is not asked for: that could be what is broken.
            pressed = self._wakeup.wait(self._keys.descriptors, BRING_DOWN_PERIOD_S)
            if kill_asked() or (pressed and self._keys.pressed()):
                ask(Action.KILL)
            self._look(working)
            _each(working, self._serve)
        for station in self._stations.values():
            station.transmitter.close()
        self._recall.close()

    def _look(self, working: dict[str, Transmitter]) -> None:
        """Hand new poses to the transmitters that work; without poses they descend open loop."""
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

    def _call(self, station: Station) -> None:
        """Note that there are commands or bids for a station; called on receive threads."""
        self._called.append(station)
        self._wakeup.notify()

    def _on_pose(self) -> None:
        """Note when poses are to be judged; called on receive threads. Only the first one wakes the loop.

        Poses of vehicles that obey commands wake nobody: these commands do, a moment later.
        """
        self._poses_arrived = True
        if self._poses_wake and self._judge_poses_at_s == math.inf:
            self._judge_poses_at_s = self._clock() + POSE_PATIENCE_S
            self._wakeup.notify()

    def _poses_may_wait(self) -> bool:
        """Whether the first poses of a frame have just arrived, and no command needs them."""
        return self._clock() < self._judge_poses_at_s < math.inf and not self._called

    def _take_poses(self) -> None:
        # First, so that a pose that arrives meanwhile is either drained here or wakes the loop again.
        self._judge_poses_at_s = math.inf
        self._poses_taken_s = self._clock()
        if not self._poses_arrived:
            return
        self._poses_arrived = False
        for pose, arrived_s in self._new_poses():
            self._period_s = min(pose.period_s or 0.0, LONGEST_HELD_S)
            for station in self._stations.values():
                station.transmitter.on_pose(pose, arrived_s)

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
            for station in self._stations.values():
                station.report(now_s)


def pose_input(vehicle: str, pose: Pose) -> PoseInput:
    """Raw pose of a vehicle as the arbiter takes it."""
    quaternion = pose.quaternion_xyzw
    yaw_rad = None
    if quaternion is not None:
        x, y, z, w = quaternion
        yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return PoseInput(vehicle, pose.epoch, pose.frame, pose.position_m, pose.period_s, yaw_rad, pose.latency_s)


def _each(working: dict[str, Transmitter], act: Callable[[Transmitter], object]) -> None:
    """Do something with every transmitter; one that fails is reported and given up."""
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
    vehicles down because their commands are silent; the gateway goes on sending throttle low and serves again
    when the bus is back.

    Raises
    ------
    BusUnreachableError
        No router answers.
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
        settle()
        try:
            run_until_stopped(gateway, caught)
        except BaseException:
            gateway.bring_down(lambda: _kill_asked(caught))
            raise
        finally:
            heartbeat.ending()
    wakeup.close()


def run_until_stopped(gateway: Gateway, caught: set[int]) -> None:
    """Serve until a signal asks to end, then bring the vehicles down.

    Parameters
    ----------
    gateway
        The gateway.
    caught
        Signals that have arrived; SIGUSR1 is taken out when it has been obeyed.
    """
    while not caught & {signal.SIGTERM, signal.SIGINT}:
        gateway.wait()
        gateway.step()
        _obey_kill(gateway, caught)
    gateway.shut_down(lambda: _obey_kill(gateway, caught))


def _kill_asked(caught: set[int]) -> bool:
    asked = signal.SIGUSR1 in caught
    caught.discard(signal.SIGUSR1)
    return asked


def _obey_kill(gateway: Gateway, caught: set[int]) -> None:
    if _kill_asked(caught):
        gateway.kill("SIGUSR1")
