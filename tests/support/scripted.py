"""A fleet without helicopters: its vehicles reply and publish statuses as a test requires."""

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from rcopterx.bus import channels
from rcopterx.bus.host_messages import SubjectState, TrackerStatus
from rcopterx.bus.messages import (
    AgentStatus,
    Kill,
    LeaderLink,
    Plan,
    Pose,
    SetPoint,
    TransmitterStatus,
    ZoneSet,
)
from rcopterx.bus.requests import Fly, Follow, GoTo, Lead, Reply, SetZones
from rcopterx.bus.session import BusAddress, Incoming, Session
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet
from support.plans import plan_of
from support.statuses import flying_status
from support.waiting import DEADLINE_S, PatientClock, wait_for

PERIOD_S = 0.01
READING_S = 0.02
"""Of the clock; that of a fleet is read at every message."""
PATH_S = 0.5
"""Every trajectory takes as long."""
VERBS = [
    "arm",
    "disarm",
    "kill",
    "reset",
    "take_off",
    "land",
    "go_to",
    "fly",
    "follow",
    "lead",
    "excite",
    "tune",
    "suspend",
    "resume",
    "set_zones",
    "set_light",
]
NEXT_PHASE = {"arm": "armed", "take_off": "flying", "land": "armed", "disarm": "ground", "kill": "ground"}
NEXT_STATE = {"arm": "armed", "disarm": "disarmed", "kill": "killed", "reset": "disarmed"}


def fleet_file_text(address: BusAddress, vehicles: tuple[str, ...] = ("h1", "h2")) -> str:
    """Fleet file of a bus that is up already."""
    tables = "\n".join(
        f'[vehicles.{name}]\nsubject = "{name}"\ntransmitter = {{ port = "radio-{name}" }}'
        for name in vehicles
    )
    port = address.endpoints[0].rpartition(":")[2]
    namespace = f'[bus]\nnamespace = "{address.namespace}"\n' if address.namespace else ""
    return f'name = "{address.fleet}"\n[hosts.main]\nrouter_port = {port}\n{namespace}{tables}\n'


class ScriptedVehicle:
    """Behaviour of one vehicle; change the attributes while it runs."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.phase = "ground"
        self.state = "disarmed"
        self.ready = True
        self.armed: bool | None = None
        self.pose_problems: tuple[str, ...] = ()
        self.pose_age_s = 0.01
        self.refusals: dict[str, str] = {}
        self.silent: set[str] = set()
        self.speaks = True
        self.agent_speaks = True  # while `speaks`
        self.stuck: set[str] = set()
        self.requests: list[object] = []
        self.kills: list[Kill] = []
        self.counts: dict[str, int] = {}
        self.diagnostics: dict[str, Any] = {}
        self.following: tuple[LeaderLink, ...] = ()
        self.assigned: tuple[LeaderLink, ...] = ()
        self.following_mode = "follow"
        self.set_point = SetPoint(position_m=(0.0, 0.0, 0.0), yaw_rad=0.0)
        self.position_m = (0.1, 0.2, 0.3)
        self.occluded_s: float | None = None
        self.yaw_rad = 0.0
        self.error_m: float | None = None
        self.plan: Plan | None = None
        self.reason = "scripted"  # of the state of the arbiter
        self.path_left_s = 0.0
        self.zones: ZoneSet | None = None

    def answer(self, incoming: Incoming) -> None:
        self.requests.append(incoming.request)
        if incoming.verb in self.silent:
            return
        refusal = self.refusals.get(incoming.verb)
        if refusal is None and incoming.verb not in self.stuck:
            self.phase = NEXT_PHASE.get(incoming.verb, self.phase)
            self.state = NEXT_STATE.get(incoming.verb, self.state)
            self._obey(incoming.request)
        incoming.answer(Reply(accepted=refusal is None, reason=refusal or self._news(incoming.request)))

    def take_kill(self, name: str, kill: Kill) -> None:
        """Obey unless stuck."""
        self.kills.append(kill)
        if "kill" not in self.stuck and (not kill.vehicles or name in kill.vehicles):
            self.phase, self.state = "ground", "killed"

    def _obey(self, request: object) -> None:
        """Be at once where one was sent."""
        if isinstance(request, GoTo):
            self.set_point = request.set_point
            self.plan_at(request.set_point.position_m, request.set_point.yaw_rad)
        elif isinstance(request, Fly):
            self.path_left_s = PATH_S
            x, y, z, yaw_rad = request.knots.to_numpy()[-1, 1:5].tolist()
            self.set_point = SetPoint(position_m=(x, y, z), yaw_rad=yaw_rad)
            self.plan_at((x, y, z), yaw_rad)
        elif isinstance(request, Follow):
            self.following = self.assigned = request.following
            self.plan_at(self.position_m)
        elif isinstance(request, SetZones):
            self.zones = request.zones
        elif isinstance(request, Lead):
            self.following = self.assigned = ()
            self.set_point = SetPoint(position_m=self.position_m, yaw_rad=self.yaw_rad)

    def plan_at(
        self, position_m: tuple[float, float, float], yaw_rad: float = 0.0, error_m: float = 0.0
    ) -> None:
        """Fly somewhere, so far from the reference."""
        x, y, z = position_m
        self.position_m, self.yaw_rad, self.error_m = position_m, yaw_rad, error_m
        self.plan = plan_of(
            self.name, position_m=position_m, yaw_rad=yaw_rad, reference_m=(x - error_m, y, z),
            following=self.following,
        )  # fmt: skip

    def _news(self, request: object) -> str:
        return f"{self.name} follows {request.following[0].leader}" if isinstance(request, Follow) else ""

    @property
    def verbs(self) -> list[str]:
        """Requests in the order they came, by type."""
        return [type(request).__name__ for request in self.requests]

    def agent_status(self) -> AgentStatus:
        self.path_left_s = max(0.0, self.path_left_s - PERIOD_S)
        return flying_status(
            phase=self.phase,
            set_point=self.set_point,
            position_m=self.position_m,
            yaw_rad=self.yaw_rad,
            error_m=self.error_m,
            following=self.following,
            assigned=self.assigned,
            following_mode=self.following_mode,
            pose_age_s=self.pose_age_s,
            fallbacks=self.counts,
            path_left_s=self.path_left_s,
            zones=self.zones,
            **self.diagnostics,
        )

    def pose(self) -> Pose:
        seen = self.occluded_s is None
        return Pose(
            epoch=1,
            frame=1,
            period_s=0.02,
            latency_s=0.0,
            received_s=0.0,
            occluded=not seen,
            position_m=self.position_m if seen else None,
            quaternion_xyzw=(0.0, 0.0, 0.0, 1.0) if seen else None,
        )

    def transmitter_status(self) -> TransmitterStatus:
        return TransmitterStatus(
            state=self.state,
            reason=self.reason,
            link="open",
            module="module speaks",
            ready=self.ready,
            armed=self.armed,
            pose_problems=self.pose_problems,
        )


def patient_fleet(file: FleetFile, host: str | None = None, timeout_s: float = DEADLINE_S) -> Fleet:
    """The scripting interface of scripted vehicles: no stall of this process makes them silent or late."""
    return Fleet(file, host, max(timeout_s, DEADLINE_S), PatientClock(READING_S))


@contextmanager
def scripted(session: Session, *names: str, tracker: str = "up") -> Iterator[dict[str, ScriptedVehicle]]:
    """Vehicles that use a session until the block is left."""
    vehicles = {name: ScriptedVehicle(name) for name in names}
    for name in names:
        session.serve(name, VERBS)
    kills = [
        session.subscribe(channels.KILL, channels.FLEET_UNIT, depth=8, fleet=fleet)
        for fleet in (session.address.fleet, channels.EVERY_FLEET)
    ]
    stop = threading.Event()

    def live() -> None:
        while not stop.wait(PERIOD_S):
            for received in [received for inbox in kills for received in inbox.drain()]:
                for name, vehicle in vehicles.items():
                    vehicle.take_kill(name, received.message)
            for incoming in session.pending():
                vehicles[incoming.unit].answer(incoming)
            for name, vehicle in vehicles.items():
                if vehicle.speaks and vehicle.agent_speaks:
                    session.publish(channels.AGENT_STATUS, name, vehicle.agent_status())
                if vehicle.speaks:
                    session.publish(channels.TRANSMITTER_STATUS, name, vehicle.transmitter_status())
                if vehicle.plan is not None:
                    session.publish(channels.PLAN, name, vehicle.plan)
                session.publish(channels.POSE, name, vehicle.pose())
            session.publish(
                channels.TRACKER_STATUS,
                channels.TRACKER_UNIT,
                TrackerStatus(
                    state=tracker,
                    trying="is silent [/dev/null]",
                    address="x:801",
                    period_s=0.02,
                    subjects=tuple(
                        SubjectState(subject=name, vehicle=name, occluded_s=vehicle.occluded_s)
                        for name, vehicle in vehicles.items()
                    ),
                ),
            )

    thread = threading.Thread(target=live)
    thread.start()
    try:
        yield vehicles
    finally:
        stop.set()
        thread.join()


def put(
    vehicles: dict[str, ScriptedVehicle], fleet: Fleet, phase: str, names: Iterable[str] = ("h1", "h2")
) -> None:
    """Change the phase of vehicles and wait until the fleet knows."""
    for name in names:
        vehicles[name].phase = phase
        vehicles[name].state = "armed"
    wait_for(lambda: all(fleet.state_of(name).phase == phase for name in names), f"not {phase}")
