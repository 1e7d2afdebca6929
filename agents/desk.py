"""Answers requests to one agent: checks what is asked, hands it to the pilot, says why not."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from agents.formation import FormationOffset
from agents.guidance import Link
from agents.leaders import Leaders
from agents.phases import Phase
from agents.pilot import Pilot
from agents.settings import AgentSettings
from bus.messages import AgentStatus, Following
from bus.requests import Follow, GoTo, Land, Lead, Reply, TakeOff
from bus.session import Incoming

VERBS = ["take_off", "land", "go_to", "follow", "lead"]
FIRST_PLAN_LIMIT_S = 0.3


def link_of(following: Following) -> Link:
    """A link of the guidance from its message."""
    offset = FormationOffset(
        np.array(following.offset_m),
        following.yaw_offset_rad,
        "heading" if following.frame == "heading" else "inertial",
    )
    return Link(following.leader, offset, following.weight)


def following_of(link: Link, time_s: float) -> Following:
    """Message of a link with the offset of this moment."""
    offset = link.offset_at(time_s)
    x, y, z = offset.position_m.tolist()
    return Following(
        leader=link.leader,
        offset_m=(x, y, z),
        yaw_offset_rad=offset.yaw_rad,
        frame=offset.frame,
        weight=link.weight,
    )


@dataclass(frozen=True)
class _Waiting:
    incoming: Incoming
    request: Follow
    deadline_s: float


class Desk:
    """Requests of one agent.

    Parameters
    ----------
    settings, pilot, leaders
        The agent's own.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self, settings: AgentSettings, pilot: Pilot, leaders: Leaders, clock: Callable[[], float]
    ) -> None:
        self._settings = settings
        self._pilot = pilot
        self._leaders = leaders
        self._clock = clock
        self._waiting: list[_Waiting] = []

    def handle(self, incoming: Incoming) -> None:
        """Answer a request, now or as soon as the plan it depends on has been seen."""
        request = incoming.request
        if isinstance(request, Follow):
            refusal = self._follow_problem(request)
            if refusal is None:
                deadline_s = self._clock() + FIRST_PLAN_LIMIT_S
                self._waiting.append(_Waiting(incoming, request, deadline_s))
                self._keep_leaders()
                self.settle_waiting()
                return
        elif not self._pilot.ready and not isinstance(request, Lead):
            refusal = "the motion capture has not seen the vehicle"
        elif isinstance(request, TakeOff):
            refusal = self._take_off(request)
        elif isinstance(request, Land):
            refusal = self._pilot.guidance.land(self._pilot.estimate, self._pilot.clock.time_s)
        elif isinstance(request, GoTo):
            refusal = self._go_to(request)
        elif isinstance(request, Lead):
            refusal = self._lead()
        else:
            refusal = f"an agent does not serve {incoming.verb}"
        incoming.answer(Reply(accepted=refusal is None, reason=refusal or ""))

    def settle_waiting(self) -> None:
        """Decide on follow requests whose leaders' plans have arrived, or have not in time."""
        if not self._waiting:
            return
        undecided, self._waiting = self._waiting, []
        for waiting in undecided:
            names = [link.leader for link in waiting.request.following]
            missing = [name for name in names if self._leaders.newest(name) is None]
            if missing and self._clock() < waiting.deadline_s:
                self._waiting.append(waiting)
                continue
            refusal = f"no plan from {', '.join(missing)}" if missing else self._follow(waiting.request)
            waiting.incoming.answer(Reply(accepted=refusal is None, reason=refusal or ""))
        self._keep_leaders()

    def _keep_leaders(self) -> None:
        """Hear the leaders of now and those that requests wait for."""
        followed = {link.leader for link in self._pilot.guidance.links}
        self._leaders.keep(
            followed.union(
                *({link.leader for link in waiting.request.following} for waiting in self._waiting)
            )
        )

    def resume(self, status: AgentStatus) -> None:
        """Take over the task of an earlier process of this agent."""
        self._pilot.guidance.links = tuple(link_of(following) for following in status.following)
        self._leaders.keep(following.leader for following in status.following)
        if status.phase == Phase.LANDING:
            self._pilot.guidance.land(self._pilot.estimate, self._pilot.clock.time_s)
        elif not status.following:
            self._pilot.guidance.go_to(np.array(status.set_point.position_m), status.set_point.yaw_rad)

    def _take_off(self, request: TakeOff) -> str | None:
        floor_m = float(self._pilot.estimate.motion[2])
        top_m = self._settings.volume_max_m[2]
        if floor_m + request.height_m > top_m:
            return f"height_m: {request.height_m:g} m is above the flight volume, which ends at {top_m:g} m"
        return self._pilot.take_off(request.height_m)

    def _go_to(self, request: GoTo) -> str | None:
        position = request.set_point.position_m
        for axis, value, low, high in zip(
            "xyz", position, self._settings.volume_min_m, self._settings.volume_max_m, strict=True
        ):
            if not low <= value <= high:
                return f"{axis}: {value:g} m is outside the flight volume {low:g} .. {high:g} m"
        return self._pilot.guidance.go_to(np.array(position), request.set_point.yaw_rad)

    def _lead(self) -> str | None:
        self._pilot.guidance.lead(self._pilot.estimate)
        self._keep_leaders()
        return None

    def _follow_problem(self, request: Follow) -> str | None:
        names = [link.leader for link in request.following]
        for name in names:
            if name == self._settings.vehicle:
                return "a vehicle cannot follow itself"
            if name not in self._settings.vehicles:
                return f"unknown vehicle {name!r}, known are {', '.join(self._settings.vehicles)}"
        if len(set(names)) != len(names):
            return "a leader is named twice"
        return None

    def _follow(self, request: Follow) -> str | None:
        for link in request.following:
            cycle = self._leaders.cycle_through(link.leader)
            if cycle is not None:
                line = " follows ".join((*cycle,))
                return f"a cycle: {line}"
        pilot = self._pilot
        links = [link_of(following) for following in request.following]
        plans = self._leaders.plans(pilot.clock)
        pilot.guidance.follow(links, plans, pilot.estimate, pilot.clock.time_s, request.transition_s)
        return None
