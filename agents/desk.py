"""Answers requests to one agent: checks what is asked, hands it to the pilot, says why not."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from agents.configuration import Configuration
from agents.external import External
from agents.formation import FormationOffset
from agents.guidance import Link
from agents.leaders import Leaders
from agents.neighbours import Neighbours, formation_of
from agents.paths import FlightPath, begun_from, path_problem, run_in_time_s
from agents.phases import Phase
from agents.pilot import Pilot
from agents.placement import Room, offset_problem, place_problem
from agents.regrouping import Regrouping
from agents.settings import AgentSettings
from agents.topology import in_words
from agents.tuning import Tuning
from bus.messages import AgentStatus, Following
from bus.requests import (
    CommitLeaders,
    Fly,
    Follow,
    GoTo,
    Land,
    Lead,
    PrepareLeaders,
    ReleaseControl,
    Reply,
    TakeControl,
    TakeOff,
    Tune,
    WithdrawLeaders,
)
from bus.session import Incoming

VERBS = [
    "take_off", "land", "go_to", "fly", "follow", "lead", "tune", "take_control", "release_control",
    "prepare_leaders", "commit_leaders", "withdraw_leaders",
]  # fmt: skip
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
    return _following(link, link.offset_at(time_s))


def following_at_rest(link: Link) -> Following:
    """Message of a link with the offset to be reached."""
    return _following(link, link.target)


def _following(link: Link, offset: FormationOffset) -> Following:
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
    request: Follow | PrepareLeaders
    deadline_s: float


class Desk:
    """Requests of one agent.

    Parameters
    ----------
    settings, pilot, leaders, neighbours, tuning, external
        The agent's own.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        leaders: Leaders,
        neighbours: Neighbours,
        tuning: Tuning,
        external: External,
        clock: Callable[[], float],
    ) -> None:
        self._settings = settings
        self._pilot = pilot
        self._leaders = leaders
        self._neighbours = neighbours
        self._tuning = tuning
        self._external = external
        self._tuned_by: Incoming | None = None
        self._clock = clock
        self._room = Room(settings.volume_min_m, settings.volume_max_m, settings.minimum_distance_m)
        self.regrouping = Regrouping(clock)
        self._waiting: list[_Waiting] = []
        self.cycles_from_frame = 0
        """Frame from which on a plan that names this vehicle as an ancestor means a cycle."""

    def handle(self, incoming: Incoming) -> None:
        """Answer a request, now or as soon as the plan it depends on has been seen."""
        request = incoming.request
        accepted = ""
        if isinstance(request, Follow | PrepareLeaders):
            refusal = self._leaders_problem(request)
            if refusal is None:
                deadline_s = self._clock() + FIRST_PLAN_LIMIT_S
                self._waiting.append(_Waiting(incoming, request, deadline_s))
                self.keep_leaders()
                self.settle_waiting()
                return
        elif isinstance(request, Tune):
            refusal = self._tune(request)
            if refusal is None:
                self._tuned_by = incoming
                return
        elif isinstance(request, TakeControl):
            refusal = (
                "another controller is being prepared" if self._tuning.busy else self._external.take(request)
            )
            accepted = f"{request.source} flies {self._settings.vehicle}"
        elif isinstance(request, ReleaseControl):
            refusal = self._external.release(request.source)
        elif isinstance(request, CommitLeaders):
            refusal = self.regrouping.commit(
                request.operation, request.epoch, request.frame, self._pilot.clock
            )
        elif isinstance(request, WithdrawLeaders):
            refusal = None
            self.regrouping.withdraw(request.operation)
            self.keep_leaders()
        elif not self._pilot.ready and not isinstance(request, Lead):
            refusal = "the motion capture has not seen the vehicle"
        elif isinstance(request, TakeOff):
            refusal = self._take_off(request)
        elif isinstance(request, Land):
            refusal = self._pilot.guidance.land(self._pilot.estimate, self._pilot.clock.time_s)
        elif isinstance(request, GoTo):
            refusal = self._go_to(request)
        elif isinstance(request, Fly):
            refusal, accepted = self._fly(request)
        elif isinstance(request, Lead):
            refusal = self._lead()
            accepted = f"{self._settings.vehicle} follows nobody"
        else:
            refusal = f"an agent does not serve {incoming.verb}"
        incoming.answer(_reply(refusal, accepted))

    def settle_waiting(self) -> None:
        """Decide on requests whose leaders' plans have arrived, or have not in time."""
        if not self._waiting:
            return
        undecided, self._waiting = self._waiting, []
        for waiting in undecided:
            names = [link.leader for link in waiting.request.following]
            missing = [name for name in names if self._leaders.fresh(name, self._clock()) is None]
            if missing and self._clock() < waiting.deadline_s:
                self._waiting.append(waiting)
                continue
            refusal, accepted = "; ".join(map(self._absence, missing)) or None, ""
            if refusal is None:
                refusal, accepted = self._decide(waiting.request)
            waiting.incoming.answer(_reply(refusal, accepted))
        self.keep_leaders()

    def settle_tuning(self) -> bool:
        """Let what was prepared take over, and answer who asked for it; True if there was something."""
        outcome = self._tuning.finish()
        if outcome is None:
            return False
        if self._tuned_by is not None:
            refused = isinstance(outcome, ValueError)
            self._tuned_by.answer(_reply(str(outcome) if refused else None, "" if refused else str(outcome)))
            self._tuned_by = None
        return True

    def begin_due(self) -> None:
        """Take the prepared leaders if their frame has come."""
        pilot = self._pilot
        change = self.regrouping.due(pilot.clock)
        if change is None:
            return
        if pilot.guidance.phase is not Phase.FLYING:
            # It was told to land meanwhile, or the transmitter gateway flies it.
            self.regrouping.events["regrouping_missed"] += 1
            self.keep_leaders()
            return
        if change.links:
            # For a moment the plans of the new leaders still tell of the lines that are given up now.
            self.cycles_from_frame = pilot.clock.current_frame + len(self._settings.vehicles) + 1
            plans = self._leaders.plans(pilot.clock, self.cycles_from_frame)
            pilot.guidance.follow(change.links, plans, pilot.estimate, pilot.clock.time_s, None)
        else:
            pilot.guidance.take_lead(change.position_m, change.yaw_rad)
        self.keep_leaders()

    def keep_leaders(self) -> None:
        """Hear the leaders of now, those that return perhaps, and those that requests wait for."""
        guidance = self._pilot.guidance
        followed = {link.leader for link in (*guidance.links, *guidance.assigned)}
        self._leaders.keep(
            followed.union(
                self.regrouping.leaders,
                *({link.leader for link in waiting.request.following} for waiting in self._waiting),
            )
        )

    def resume(self, status: AgentStatus) -> None:
        """Take over the task of an earlier process of this agent."""
        self._restore(status)
        guidance = self._pilot.guidance
        guidance.assigned = tuple(link_of(following) for following in status.assigned or status.following)
        # An offset on its way to its target begins its way anew, from where the vehicle is then.
        guidance.follow_instead(guidance.assigned)
        self.keep_leaders()
        if status.phase == Phase.LANDING:
            guidance.land(self._pilot.estimate, self._pilot.clock.time_s)
        elif not guidance.assigned and not status.path_left_s:
            # Of a trajectory only its end is known: the vehicle holds the place where it is.
            guidance.go_to(np.array(status.set_point.position_m), status.set_point.yaw_rad)

    def _restore(self, status: AgentStatus) -> None:
        """Go on with what was tuned before."""
        wanted = Configuration(
            status.controller, status.estimator, status.controller_settings, status.estimator_settings
        )
        if wanted != self._tuning.configuration and not self._tuning.busy:
            self._tuning.begin(wanted)

    def _tune(self, request: Tune) -> str | None:
        if self._tuning.busy:
            return "another change is being prepared"
        if self._external.client:
            return f"{self._external.client} flies it from outside"
        present = self._tuning.configuration
        wanted = present.changed(
            request.controller, request.controller_settings, request.estimator, request.estimator_settings
        )
        if wanted == present:
            return f"nothing changes: it flies with {present.controller} and {present.estimator} like this"
        self._tuning.begin(wanted)
        return None

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

    def _fly(self, request: Fly) -> tuple[str | None, str]:
        """Refusal, or None and how long it takes, of a trajectory."""
        guidance, time_s = self._pilot.guidance, self._pilot.clock.time_s
        problem = guidance.flight_problem()
        if problem is not None:
            return problem, ""
        present = guidance.source.sample(time_s, 1.0, 1).samples[0]
        wanted = FlightPath(request.knots.to_numpy())
        run_in_s = run_in_time_s(wanted, present)
        path = begun_from(wanted, present, run_in_s)
        problem = path_problem(
            path, self._pilot.model, self._settings.volume_min_m, self._settings.volume_max_m
        )
        if problem is not None:
            return problem, ""
        guidance.fly(path, time_s)
        return None, f"{path.duration_s:.1f} s, the first {run_in_s:.1f} s on the way to its beginning"

    def _lead(self) -> str | None:
        self._pilot.guidance.lead(self._pilot.estimate)
        self.keep_leaders()
        return None

    def _leaders_problem(self, request: Follow | PrepareLeaders) -> str | None:
        """What is wrong with a request for other leaders, whatever they do."""
        names = [link.leader for link in request.following]
        for name in names:
            if name == self._settings.vehicle:
                return f"{name} cannot follow itself"
            if name not in self._settings.vehicles:
                return f"unknown vehicle {name!r}, known are {', '.join(self._settings.vehicles)}"
        if len(set(names)) != len(names):
            return "a leader is named twice"
        if isinstance(request, Follow):
            return None
        if self._pilot.guidance.phase is not Phase.FLYING:
            return f"leaders change together only in flight, the phase is {self._pilot.guidance.phase}"
        if bool(names) == (request.set_point is not None):
            return "set_point: needed exactly where following is empty"
        if request.set_point is not None:
            problem = self._room.outside(np.array(request.set_point.position_m))
            if problem is not None:
                return problem
        return self.regrouping.busy(request.operation)

    def _absence(self, name: str) -> str:
        status = self._neighbours.statuses().get(name)
        if status is None:
            return f"no plan from {name}: nothing is heard from its agent"
        return f"no plan from {name}: its phase is {status.phase}"

    def _decide(self, request: Follow | PrepareLeaders) -> tuple[str | None, str]:
        """Refusal, or None and what happens, of a request whose leaders are all heard."""
        following = request.following
        refusal = self._grounded(following) if self._pilot.guidance.rotor_on else None
        if refusal is not None:
            return refusal, ""
        if isinstance(request, PrepareLeaders):
            links = [link_of(item) for item in following]
            self.regrouping.prepare(request.operation, links, request.set_point)
            return None, f"{self._settings.vehicle} is ready"
        refusal = self._follow_problem(following)
        if refusal is not None:
            return refusal, ""
        self._follow(request)
        return None, self._line(following)

    def _grounded(self, following: Sequence[Following]) -> str | None:
        """Which of the leaders does not fly freely."""
        for link in following:
            plan = self._leaders.newest(link.leader)
            if plan is None or (plan.airborne and plan.followable):
                continue
            status = self._neighbours.statuses().get(link.leader)
            phase = "on the floor" if not plan.airborne else "not in free flight"
            return f"{link.leader} is {phase}" + (f", its phase is {status.phase}" if status else "")
        return None

    def _follow_problem(self, following: tuple[Following, ...]) -> str | None:
        for link in following:
            line = self._leaders.cycle_through(link.leader)
            if line is not None:
                return f"a cycle: {in_words((self._settings.vehicle, *line))}"
        problem = offset_problem(self._settings.vehicle, following, self._room)
        if problem is not None or not self._pilot.guidance.rotor_on:
            return problem
        links, heads = formation_of(self._neighbours.statuses(), flying=(self._settings.vehicle,))
        for link in following:
            plan = self._leaders.newest(link.leader)
            if link.leader not in links and plan is not None:
                # Its plan is here, its status not yet: where the plan ends.
                heads[link.leader] = plan.trajectory.to_numpy()[-1, :4].copy()
                links = {**links, link.leader: ()}
        return place_problem(self._settings.vehicle, following, links, heads, self._room)

    def _follow(self, request: Follow) -> None:
        pilot = self._pilot
        links = [link_of(following) for following in request.following]
        plans = self._leaders.plans(pilot.clock, self.cycles_from_frame)
        pilot.guidance.follow(links, plans, pilot.estimate, pilot.clock.time_s, request.transition_s)

    def _line(self, following: Sequence[Following]) -> str:
        """Whom the vehicle follows, and whom they follow."""
        names = [link.leader for link in following]
        line = self._leaders.ancestors(names)
        if len(names) == 1:
            return in_words((self._settings.vehicle, *line))
        further = [name for name in line if name not in names]
        end = f", who follow {', '.join(further)}" if further else ""
        return f"{self._settings.vehicle} follows {', '.join(names)}{end}"


def _reply(refusal: str | None, accepted: str) -> Reply:
    return Reply(accepted=refusal is None, reason=(accepted if refusal is None else refusal)[:400])
