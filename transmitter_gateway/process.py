"""The transmitter gateway process: commands and poses in, serial frames out."""

import math
import signal
import sys
from concurrent.futures import ThreadPoolExecutor

from rcopterx.bus import channels
from rcopterx.bus.heartbeat import own_heartbeat
from rcopterx.bus.messages import Pose
from rcopterx.bus.realtime import prepare_loop, request_realtime
from rcopterx.bus.session import Session
from rcopterx.bus.subscription import Subscription
from rcopterx.bus.wakeup import Wakeup
from rcopterx.transmitter_gateway.inputs import Action, PoseInput
from rcopterx.transmitter_gateway.kill_keys import KillKeys
from rcopterx.transmitter_gateway.radios import Radios
from rcopterx.transmitter_gateway.settings import GatewaySettings
from rcopterx.transmitter_gateway.transmitter_node import TransmitterNode

STATUS_PERIOD_S = 0.2
POSES_KEPT = 64  # of one vehicle: more than arrive between two turns, also from a fast Tracker


class Gateway:
    """The radios of one process on the bus."""

    def __init__(self, settings: GatewaySettings, session: Session, radios: Radios, realtime: bool) -> None:
        self._session, self._radios, self._clock = session, radios, session.clock
        self.nodes = {
            name: TransmitterNode(transmitter, session, realtime)
            for name, transmitter in radios.transmitters.items()
        }
        self._poses: dict[str, Subscription[Pose]] = {
            name: session.subscribe(channels.POSE, name, depth=POSES_KEPT, waking=False)
            for name in settings.vehicles
        }
        self._kills = [
            session.subscribe(channels.KILL, channels.FLEET_UNIT, depth=4, fleet=fleet)
            for fleet in (settings.bus.fleet, channels.EVERY_FLEET)
        ]
        self._report_due_s = self._clock() + STATUS_PERIOD_S

    def wait(self) -> None:
        """Wait for a message, an answer of a module or the next deadline."""
        waiting = any(node.commands_wait for node in self.nodes.values())
        self._radios.wait(-math.inf if waiting else self._report_due_s)

    def step(self) -> None:
        """Handle what has arrived and what is due; poses first, so that every decision knows the newest."""
        for pose, arrived_s in self._new_poses():
            # Whether the rotors of vehicles at other gateways turn is not known here.
            own = self.nodes.get(pose.vehicle)
            self._radios.journal.note("pose", pose.vehicle, arrived_s, pose.epoch, pose.frame)
            explained_m = math.inf if own is None else own.transmitter.arbiter.lift_off.explained_m
            for node in self.nodes.values():
                node.transmitter.on_pose(pose, arrived_s, explained_m)
        for node in self.nodes.values():
            node.take_bids(self._clock())
            node.take_commands(self._clock)
        for kills in self._kills:
            for kill in kills.drain():
                for node in self.nodes.values():
                    node.take_kill(kill.message, self._clock())
                # The sender of a kill waits for the statuses.
                self._report_due_s = -math.inf
        for incoming in self._session.pending():
            self.nodes[incoming.unit].answer(incoming, self._clock())
        for node in self.nodes.values():
            node.serve(self._clock())
        self._report()

    def shut_down(self) -> None:
        """Bring every vehicle down, end on throttle-low frames, close the ports; kills still count."""
        self._radios.request(Action.SHUTDOWN, "gateway")
        limit_s = self._clock() + self._radios.longest_shutdown_s
        transmitters = self._radios.transmitters.values()
        while not all(transmitter.finished for transmitter in transmitters) and self._clock() < limit_s:
            self.wait()
            self.step()
        self._report_due_s = -math.inf
        self._report()
        self._radios.close()

    def bring_down(self) -> None:
        """Bring the vehicles down after an error, without the bus except for poses; see `Radios`."""
        self._radios.bring_down(self._new_poses)
        self._radios.close()

    def _new_poses(self) -> list[tuple[PoseInput, float]]:
        return [
            (pose_input(name, received.message), received.arrived_s)
            for name, poses in self._poses.items()
            for received in poses.drain()
        ]

    def _report(self) -> None:
        now_s = self._clock()
        if now_s >= self._report_due_s:
            self._report_due_s = now_s + STATUS_PERIOD_S
            for node in self.nodes.values():
                node.report(now_s)
            while (taken := self._radios.journal.take()).calls:
                self._session.publish(channels.CALLS, next(iter(self.nodes)), taken)


def pose_input(vehicle: str, pose: Pose) -> PoseInput:
    """Raw pose of a vehicle in the form of the arbiter."""
    quaternion = pose.quaternion_xyzw
    yaw_rad = tilt_rad = None
    if quaternion is not None:
        x, y, z, w = quaternion
        yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        tilt_rad = math.acos(max(-1.0, min(1.0, 1 - 2 * (x * x + y * y))))
    epoch, frame, position_m = pose.epoch, pose.frame, pose.position_m
    return PoseInput(vehicle, epoch, frame, position_m, pose.period_s, yaw_rad, pose.latency_s, tilt_rad)


def run_gateway(settings: GatewaySettings) -> None:
    """Run a transmitter gateway until SIGTERM or SIGINT, then bring its vehicles down.

    SIGUSR1 and a key on the gateway's terminal kill all of them. Vehicles that an earlier process flew are
    taken over before the bus is joined. When the bus is lost, the arbiters bring the vehicles down because
    their commands are silent; the gateway sends throttle low and serves again when the bus is back. Raises
    `BusUnreachableError` if no router answers at the start.
    """
    clock = settings.bus.clock
    wakeup = Wakeup(clock)
    caught: set[int] = set()

    def catch(number: int, _frame: object) -> None:
        caught.add(number)
        wakeup.notify()

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1):
        signal.signal(number, catch)
    realtime = request_realtime(settings.realtime_priority)
    heartbeat = own_heartbeat()
    with KillKeys(sys.stdin.fileno()) as keys:
        # In lockstep time stands still while the radios are opened.
        session = Session(settings.bus, wakeup) if clock.lockstep else None
        radios = Radios(settings, wakeup, keys, caught, heartbeat, clock.now)
        prepare_loop()
        with session or _joined_bus(settings, wakeup, radios) as session:
            gateway = Gateway(settings, session, radios, realtime)
            try:
                while not caught & {signal.SIGTERM, signal.SIGINT}:
                    gateway.wait()
                    gateway.step()
                gateway.shut_down()
            except BaseException:
                gateway.bring_down()
                raise
            finally:
                heartbeat.ending()
    wakeup.close()


def _joined_bus(settings: GatewaySettings, wakeup: Wakeup, radios: Radios) -> Session:
    """Join the bus while radios are served, as a router may be late; after an error bring vehicles down."""
    pool = ThreadPoolExecutor()
    try:
        radios.serve()
        opening = pool.submit(Session, settings.bus, wakeup)
        while not opening.done():
            radios.wait(math.inf)
            radios.serve()
        return opening.result()
    except BaseException:
        radios.bring_down(lambda: ())
        radios.close()
        raise
    finally:
        pool.shutdown(wait=False)
