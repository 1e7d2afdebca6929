"""Keeps the last reports of agents for their successors, and of gateways to find lost agents."""

from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied
from rcopterx.bus.processes import CHECKPOINT
from rcopterx.bus.requests import Recall, RecallReply
from rcopterx.bus.session import BusAddress
from rcopterx.bus.subscription import Inbox, Received
from rcopterx.deploy.hosts.guarding import FLYING, Guard, OnFloor, Runners
from rcopterx.deploy.hosts.serving import Service

M = TypeVar("M", bound=Message)

FIRST_ROUTER_S: Final = 30.0  # for the first start of the router, while all processes of the fleet start
WAIT_S: Final = 0.5  # longest wait for a request
FLOOR_S: Final = 0.25  # between two searches for vehicles on the floor whose host has died


class CheckpointService(Service):
    """Answers `recall` for vehicles of a host in its thread; knows the last frames of guarded vehicles."""

    def __init__(
        self, address: BusAddress, agents: list[str], quick_deaths: Callable[[str], int], guard: Guard
    ) -> None:
        super().__init__(address, CHECKPOINT, FIRST_ROUTER_S)
        self._quick_deaths, self._guard, self._floor_due_s = quick_deaths, guard, 0.0
        self._intents = {vehicle: self._session.subscribe(channels.INTENT, vehicle) for vehicle in agents}
        # Fifty messages per second and vehicle: they wake no thread and are read on request.
        self._applied = self._of_each(channels.APPLIED)
        self._transmitters = self._of_each(channels.TRANSMITTER_STATUS)
        self._runners = Runners()
        self._launchers: Mapping[str, Inbox[LauncherStatus]] = {}
        if guard.vehicles:
            self._launchers = self._session.subscribe_all(channels.LAUNCHER, waking=False).inboxes
        self._session.serve(address.host, ["recall"])

    def _of_each(self, channel: Channel[M]) -> Mapping[str, Inbox[M]]:
        vehicles = self._guard.vehicles
        return {name: self._session.subscribe(channel, name, waking=False) for name in vehicles}

    def _due_s(self) -> float:
        return self._session.clock() + WAIT_S

    def _step(self) -> None:
        for incoming in self._session.pending():
            if isinstance(incoming.request, Recall):
                incoming.answer(self._recall(incoming.request.vehicle))

    def _recall(self, vehicle: str) -> RecallReply:
        if vehicle not in self._intents:
            return RecallReply(accepted=False, reason=f"the agent of {vehicle} does not run here")
        received, deaths = self._intents[vehicle].latest(), self._quick_deaths(vehicle)
        if received is None:
            reason = f"{vehicle} has not reported anything yet"
            return RecallReply(accepted=False, reason=reason, quick_deaths=deaths)
        age_s = max(0.0, self._session.clock() - received.arrived_s)
        return RecallReply(accepted=True, intent=received.message, age_s=age_s, quick_deaths=deaths)

    def lost_agents(self) -> dict[str, str]:
        """Return the guarded vehicles whose agent this host shall start now, and why."""
        now_s = self._session.clock()
        lost = dict.fromkeys(self._guard.find_orphans(now_s, self.frames()), "no agent commands it in flight")
        if now_s >= self._floor_due_s:
            self._floor_due_s = now_s + FLOOR_S
            on_floor = self.on_floor()
            for vehicle in self._guard.find_orphans_on_floor(now_s, on_floor):
                lost[vehicle] = f"host {on_floor[vehicle].runner}, where its agent ran, is silent"
        return lost

    def frames(self) -> dict[str, Received[Applied]]:
        """Return the newest serial frame of each guarded vehicle, as far as one has arrived."""
        newest = {vehicle: inbox.latest() for vehicle, inbox in self._applied.items()}
        return {vehicle: frame for vehicle, frame in newest.items() if frame is not None}

    def on_floor(self) -> dict[str, OnFloor]:
        """Return the guarded vehicles that a live gateway reports to be on the floor."""
        for host, launcher in tuple(self._launchers.items()):
            if (status := launcher.latest()) is not None:
                self._runners.update(host, status.message.running, status.arrived_s)
        now_s, known = self._session.clock(), {}
        for vehicle, inbox in self._transmitters.items():
            report = inbox.latest() if inbox.alive(now_s) else None
            runner = self._runners.of(vehicle)
            if report is None or runner is None or report.message.state in FLYING:
                continue
            if (age_s := report.message.command_age_s) is not None:
                known[vehicle] = OnFloor(report.arrived_s - age_s, *runner)
        return known
