"""Serves requests to a launcher: start and stop the host or agents, read logs; publishes its status."""

import time
from collections import deque
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Final

from rcopterx.agents.load import LATE_SHARE
from rcopterx.bus import channels
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.log_messages import LauncherEvent
from rcopterx.bus.messages import AgentStatus
from rcopterx.bus.processes import AGENT, HOST_SERVICE, ROUTER
from rcopterx.bus.requests import ReadLogs, Reply, StartHost, StartVehicle, StopHost, StopVehicle, TakeVehicle
from rcopterx.bus.session import BusAddress, Incoming
from rcopterx.deploy.hosts.capacity import HostCapacity
from rcopterx.deploy.hosts.serving import Service
from rcopterx.deploy.processes.attempts import Attempts
from rcopterx.deploy.processes.supervisor import Child, Supervisor
from rcopterx.vehicles.phases import AIRBORNE

REPORT_PERIOD_S = 0.5
MAX_TEXT = 400
LAND_AFTER_S: Final = 10.0  # vehicles land if the launcher is so late: no process is replaced then


class HostService(Service):
    """Answers the requests to a launcher, except `recall`, in a thread of its own."""

    def __init__(
        self,
        address: BusAddress,
        supervisor: Supervisor,
        capacity: HostCapacity,
        events: deque[str],  # events to publish; they are removed
        home: Collection[str],  # vehicles whose agents run on this host from the start
        logs: Path,  # directory of the logs of the processes
        # Called before the processes of a host with a daemon are started. None for a host without a daemon,
        # which does not serve `start_host` and `stop_host`.
        begin: Callable[[], None] | None = None,
    ) -> None:
        super().__init__(address, HOST_SERVICE)
        self._host, self._time = address.host, address.clock.lockstep_time()
        self._capacity, self._events, self._logs = capacity, events, logs
        self._home = frozenset(home)
        self.started = begin is None  # whether the processes of the host run, and not only its daemon
        self._begin, self._supervisor = begin, supervisor
        children = supervisor.children.values()
        self._agents = {child.spec.unit: child for child in children if child.spec.role == AGENT}
        self._turns, self._stalled_s = 0, 0.0
        self._attempt = Attempts(self._session.clock)
        self._report_at_s = self._reported_s = 0.0  # the latter in real time
        self._statuses = self._session.subscribe_all(channels.AGENT_STATUS, waking=False)
        self._session.serve(self._host, ["start_vehicle", "stop_vehicle", "take_vehicle", "read_logs"])
        if begin is not None:
            self._session.serve(self._host, ["start_host", "stop_host"])

    def _due_s(self) -> float:
        return self._report_at_s

    def _step(self) -> None:
        now_s = self._session.clock()
        for incoming in self._session.pending():
            if isinstance(incoming.request, ReadLogs) and self._time is None:
                # A disk may block that.
                Thread(target=self._reply, args=[incoming], name="logs", daemon=True).start()
            else:
                self._reply(incoming)
            self._report_at_s = now_s
        if now_s >= self._report_at_s:
            self._report_at_s = now_s + REPORT_PERIOD_S
            # A launcher that was stopped as a whole is late as a whole.
            elapsed_s = min(time.monotonic() - self._reported_s, 2 * REPORT_PERIOD_S)
            self._reported_s = time.monotonic()
            self._events.extend(self._attempt("reporting", partial(self._report, elapsed_s)))

    def _reply(self, incoming: Incoming) -> None:
        try:
            reply = self._answer(incoming.request)
        except Exception as error:  # noqa: BLE001 - whatever fails, the next request is answered
            reason = f"the launcher of {self._host} failed: {error}"[:MAX_TEXT]
            reply = Reply(accepted=False, reason=reason)
        incoming.answer(reply)

    def _report(self, elapsed_s: float) -> None:
        self._check_supervisor(elapsed_s)
        while self._events:
            event = LauncherEvent(text=self._events.popleft()[:MAX_TEXT])
            self._session.publish(channels.LAUNCHER_EVENT, self._host, event)
        self._session.publish(channels.LAUNCHER, self._host, self._status())

    def _check_supervisor(self, elapsed_s: float) -> None:
        """Land the vehicles when the loop that replaces processes makes no turns."""
        before_s, turns = self._stalled_s, self._supervisor.turns
        self._stalled_s = before_s + elapsed_s if turns == self._turns > 0 else 0.0
        self._turns = turns
        if before_s < LAND_AFTER_S <= self._stalled_s:
            self._events.append(f"launcher: has not checked its processes for {LAND_AFTER_S:g} s; landing")
            self._supervisor.land()

    def _answer(self, request: object) -> Reply:
        if isinstance(request, StartHost):
            return self._start_host(request.without)
        if isinstance(request, StopHost):
            return self._stop_host()
        if isinstance(request, ReadLogs):
            from rcopterx.deploy.processes.log_reading import read_page

            return read_page(self._logs, request)
        if isinstance(request, StartVehicle | StopVehicle | TakeVehicle):
            if (child := self._agents.get(request.vehicle)) is None:
                reason = f"the fleet file does not let the agent of {request.vehicle} run on {self._host}"
                return Reply(accepted=False, reason=reason)
            return self._answer_for_vehicle(request, child)
        return Reply(accepted=False, reason="a launcher starts and stops vehicles")

    def _start_host(self, without: Collection[str]) -> Reply:
        idle = [child for child in self._supervisor.children.values() if child.spec.role != ROUTER]
        if self.started:
            return Reply(accepted=True, reason=f"{self._host} runs already")
        if self._begin is not None:
            self._begin()
        self.started = True
        for child in idle:
            vehicle = child.spec.unit
            child.wanted = child.spec.role != "agent" or (vehicle in self._home and vehicle not in without)
        return Reply(accepted=True, reason=f"{self._host} is started")

    def _stop_host(self) -> Reply:
        statuses = {vehicle: self._last_status(vehicle) for vehicle in tuple(self._statuses.inboxes)}
        if flying := [name for name, status in statuses.items() if status and status.phase in AIRBORNE]:
            return Reply(accepted=False, reason=f"{', '.join(sorted(flying))} in the air; land first")
        self.started = False
        for child in self._supervisor.children.values():
            child.wanted = child.spec.role == ROUTER
        return Reply(accepted=True, reason=f"{self._host} stops")

    def _answer_for_vehicle(self, request: StartVehicle | StopVehicle | TakeVehicle, child: Child) -> Reply:
        vehicle = request.vehicle
        if isinstance(request, StartVehicle):
            reason = f"{vehicle} takes part already" if child.wanted else f"{vehicle} is started"
            self._want(child, True)
            return Reply(accepted=True, reason=reason)
        if isinstance(request, StopVehicle):
            status = self._last_status(vehicle)
            if status and status.phase in AIRBORNE and status.host in (None, self._host):
                reason = f"{vehicle} is in the air, its phase is {status.phase}; land it first"
                return Reply(accepted=False, reason=reason)
            self._want(child, False)
            return Reply(accepted=True, reason=f"{vehicle} leaves")
        if child.wanted:
            return Reply(accepted=True, reason=f"the agent of {vehicle} runs on {self._host} already")
        child.take_over = child.wanted = True
        return Reply(accepted=True, reason=f"the agent of {vehicle} starts on {self._host}")

    def _want(self, child: Child, wanted: bool) -> None:
        child.wanted = wanted
        if self._time is not None:
            self._time.want(child.spec.name, wanted)

    @property
    def agents_are_late(self) -> bool:
        """Whether the commands of an agent of this host are late."""
        statuses = (self._last_status(vehicle) for vehicle in self._agents)
        return any(status is not None and status.late_share > LATE_SHARE for status in statuses)

    def _last_status(self, vehicle: str) -> AgentStatus | None:
        inbox = self._statuses.inboxes.get(vehicle)
        received = None if inbox is None or not inbox.alive(self._session.clock()) else inbox.latest()
        return None if received is None else received.message

    def _status(self) -> LauncherStatus:
        supervisor, children = self._supervisor, self._supervisor.children
        wanted = {name: child.wanted for name, child in self._agents.items()}
        return LauncherStatus(
            running=tuple(name for name, here in wanted.items() if here),
            absent=tuple(name for name, here in wanted.items() if not here and name in self._home),
            restarts={name: child.restarts for name, child in children.items()},
            spare_ready=supervisor.spares.ready() > 0,
            watchdog=supervisor.watchdog_on,
            hung={name: child.hung for name, child in children.items() if child.hung}
            | ({"spare": supervisor.spares_hung} if supervisor.spares_hung else {}),
            longest_silence_s={name: supervisor.longest_silence_s(name) for name in supervisor.running()},
            forgiven=dict(supervisor.watchdog.forgiven),
            stalled_s=self._stalled_s,
            flies=self._capacity.flies,
            measuring=self._capacity.measuring,
        )

    def close(self) -> None:
        """Leave the bus."""
        self.stop()
        # Other hosts need not start these agents: they end on purpose.
        self._session.publish(
            channels.LAUNCHER, self._host, LauncherStatus(running=(), absent=tuple(self._home))
        )
        super().close()
