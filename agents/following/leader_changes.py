"""Changes of leaders that were requested and wait for the plans of the new leaders.

If recent statuses show that the plans will come, the reply precedes the first plan: the leaders are promised.
Until the plan arrives, the vehicle flies on as before.

Several vehicles change leaders together at one frame: all prepare the change before the first commits it.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.following.leader_plans import LeaderPlans, PeerStatuses, followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import CommitLeaders, Follow, PrepareLeaders, Reply, WithdrawLeaders
from rcopterx.bus.session import Incoming
from rcopterx.control.references.columns import POSE
from rcopterx.control.references.set_points import SetPointReference
from rcopterx.formation.placement import PresentRoom, offset_problem, place_problem
from rcopterx.formation.topology import ancestors, in_words, line_between
from rcopterx.user_text import similar
from rcopterx.vehicles.phases import Phase

PREPARED_S = 3.0  # time for which a prepared change waits for its frame


class Regrouping:
    """The change that one vehicle has prepared, at most one at a time."""

    def __init__(self, clock: Callable[[], float], events: Counter[str]) -> None:
        self._clock, self._events = clock, events
        self._request: PrepareLeaders | None = None
        self._expires_s = 0.0  # when it is discarded [monotonic s]
        self._begins: tuple[int, int] | None = None  # epoch and frame, once they are known

    @property
    def leaders(self) -> set[str]:
        """Leaders of the prepared change."""
        request = self._present()
        return set() if request is None else {link.leader for link in request.following}

    def _present(self) -> PrepareLeaders | None:
        if self._request is not None and self._clock() > self._expires_s:
            self._events["regrouping_expired"] += 1
            self._request = None
        return self._request

    def busy(self, operation: str) -> str | None:
        """Return why no change can be prepared; None if one can."""
        request = self._present()
        if request is None or request.operation == operation:
            return None
        return f"another change of leaders is under way ({request.operation})"

    def prepare(self, request: PrepareLeaders) -> None:
        """Prepare a change; it replaces one of the same name."""
        self._request, self._expires_s, self._begins = request, self._clock() + PREPARED_S, None

    def commit(self, request: CommitLeaders, clock: FleetClock) -> str | None:
        """Set the frame of a change; return the reason of a refusal, or None."""
        prepared = self._present()
        if prepared is None or prepared.operation != request.operation:
            return f"nothing is prepared under {request.operation!r}"
        problem = clock.frame_problem(request.epoch, request.frame)
        if problem is None:
            self._begins = request.epoch, request.frame
        return problem

    def withdraw(self, operation: str) -> None:
        """Discard a change."""
        if self._request is not None and self._request.operation == operation:
            self._request = None

    def due(self, clock: FleetClock) -> PrepareLeaders | None:
        """Return the request whose frame has come, once; else None."""
        request, begins = self._present(), self._begins
        if request is None or begins is None or begins[0] != clock.epoch or clock.current_frame < begins[1]:
            return None
        self._request = None
        return request


FIRST_PLAN_LIMIT_S = 0.3
RECENT_STATUS_S = 0.3  # age of a status, of which five arrive in a second, that announces a plan


@dataclass(frozen=True)
class _Waiting:
    incoming: Incoming
    request: Follow | PrepareLeaders
    deadline_s: float
    promised: bool = False  # whether it was accepted before the first plan


@dataclass
class LeaderChanges:
    """Changes of the leaders of one vehicle; `clock` is monotonic [s]."""

    vehicle: str
    vehicles: Sequence[str]
    room: PresentRoom
    pilot: Pilot
    plans: LeaderPlans
    peers: PeerStatuses
    clock: Callable[[], float]

    def __post_init__(self) -> None:
        self._regrouping = Regrouping(self.clock, self.pilot.events)
        self._waiting: list[_Waiting] = []
        self.cycles_from = (0, 0)  # epoch and frame from which on an ancestor of this name means a cycle

    @property
    def waiting(self) -> bool:
        """Whether a request waits for the plans of its leaders."""
        return bool(self._waiting)

    def wait(self, incoming: Incoming, request: Follow | PrepareLeaders) -> None:
        """Refuse an impossible request at once; else decide as soon as the plans of the leaders arrive."""
        refusal = self._leaders_problem(request)
        if refusal is not None:
            incoming.answer(reply_of(refusal))
            return
        waiting = _Waiting(incoming, request, self.clock() + FIRST_PLAN_LIMIT_S)
        if isinstance(request, Follow):
            reply = self._promise(request.following)
            if reply is not None:
                incoming.answer(reply)
                if not reply.accepted:
                    return
                self._overtake()
                waiting = replace(waiting, promised=True)
        self._waiting.append(waiting)
        self.update_subscriptions()
        self.decide()

    def commit(self, request: CommitLeaders) -> str | None:
        """Apply the prepared leaders at a future frame; return the reason of a refusal, or None."""
        return self._regrouping.commit(request, self.pilot.clock)

    def withdraw(self, request: WithdrawLeaders) -> None:
        """Discard the prepared leaders."""
        self._regrouping.withdraw(request.operation)
        self.update_subscriptions()

    def promised(self) -> str | None:
        """Name the promised leaders; None if there are none."""
        names = [link.leader for item in self._waiting if item.promised for link in item.request.following]
        return f"it is about to follow {', '.join(names)}" if names else None

    def _overtake(self) -> None:
        """Refuse the requests to follow that wait, because the leaders change otherwise."""
        waiting, self._waiting = self._waiting, []
        for item in waiting:
            if isinstance(item.request, PrepareLeaders):
                self._waiting.append(item)
            elif not item.promised:
                item.incoming.answer(reply_of("overtaken by another change of leaders"))

    def lead(self) -> None:
        """Follow no leader."""
        self._overtake()
        self.pilot.guidance.lead(self.pilot.estimate)
        self.update_subscriptions()

    def decide(self) -> bool:
        """Decide requests whose leaders' plans have arrived or are overdue; return whether there was one."""
        if not self._waiting:
            return False
        undecided, self._waiting = self._waiting, []
        for waiting in undecided:
            names = [link.leader for link in waiting.request.following]
            missing = [name for name in names if self.plans.fresh(name, self.clock()) is None]
            if missing and self.clock() < waiting.deadline_s:
                self._waiting.append(waiting)
                continue
            if missing:
                reply = reply_of("; ".join(map(self._absence, missing)))
            else:
                reply = self._decide(waiting.request)
            if not waiting.promised:
                waiting.incoming.answer(reply)
            elif not reply.accepted:
                self.pilot.events["promised_leader_missing"] += 1
        self.update_subscriptions()
        return len(self._waiting) < len(undecided)

    def apply_prepared(self) -> None:
        """Apply the prepared leaders if their frame has come."""
        pilot = self.pilot
        change = self._regrouping.due(pilot.clock)
        if change is None:
            return
        if pilot.guidance.task.phase is not Phase.FLYING:
            # It lands meanwhile, or the transmitter gateway flies it.
            pilot.events["regrouping_missed"] += 1
            self.update_subscriptions()
            return
        self._overtake()
        if change.set_point is None:
            # For a moment the plans of the new leaders still name the ancestors that are given up now.
            clock = pilot.clock
            self.cycles_from = (clock.epoch, clock.current_frame + len(self.vehicles) + 1)
            self._follow(change.following, None)
        else:
            pilot.guidance.lead(pilot.estimate)
            place = change.set_point
            pilot.guidance.go_to(SetPointReference(np.array(place.position_m), place.yaw_rad))
        self.update_subscriptions()

    def update_subscriptions(self) -> None:
        """Subscribe to present and assigned leaders, and to those that requests wait for."""
        guidance = self.pilot.guidance
        followed = {link.leader for link in (*guidance.task.followed, *guidance.task.assigned)}
        self.plans.subscribe_to(
            followed.union(
                self._regrouping.leaders,
                *({link.leader for link in waiting.request.following} for waiting in self._waiting),
            )
        )

    def _leaders_problem(self, request: Follow | PrepareLeaders) -> str | None:
        """Return why leaders are impossible whatever they do; None if they are possible."""
        names = [link.leader for link in request.following]
        for name in names:
            if name == self.vehicle:
                return f"{name} cannot follow itself"
            if name not in self.vehicles:
                known = f"{', '.join(self.vehicles)}{similar(name, self.vehicles)}"
                return f"unknown vehicle {name!r}, known are {known}"
        if len(set(names)) != len(names):
            return "a leader is named twice"
        if isinstance(request, Follow):
            return None
        if self.pilot.guidance.task.phase is not Phase.FLYING:
            return f"leaders change together only in flight, the phase is {self.pilot.guidance.task.phase}"
        if bool(names) == (request.set_point is not None):
            return "set_point: needed exactly where following is empty"
        if request.set_point is not None:
            problem = self.room.now.outside(np.array(request.set_point.position_m))
            if problem is not None:
                return problem
        return self._regrouping.busy(request.operation)

    def _absence(self, name: str) -> str:
        status = self.peers.statuses().get(name)
        why = "its agent sends nothing" if status is None else f"its phase is {status.phase}"
        return f"no plan from {name}: {why}"

    def _promise(self, following: tuple[LeaderLink, ...]) -> Reply | None:
        """Return the reply by the statuses of the leaders; None if only their plans can decide."""
        now_s = self.clock()
        missing = [link.leader for link in following if self.plans.fresh(link.leader, now_s) is None]
        recent = self.peers.statuses(RECENT_STATUS_S)
        flying = all(name in recent and recent[name].phase == Phase.FLYING for name in missing)
        if not (missing and flying and self.pilot.guidance.rotor_on):
            return None
        links, _ = self.peers.formation()
        after = {**links, self.vehicle: following}
        if line_between(after, self.vehicle, self.vehicle):
            # They may have changed leaders since.
            return None
        problem = self._follow_problem(following)
        return reply_of(problem, self._in_words(following, ancestors(after, self.vehicle)))

    def _decide(self, request: Follow | PrepareLeaders) -> Reply:
        """Grant or refuse a request for which the plans of all leaders have arrived."""
        following = request.following
        refusal = self._grounded(following) if self.pilot.guidance.rotor_on else None
        if refusal is not None:
            return reply_of(refusal)
        if isinstance(request, PrepareLeaders):
            self._regrouping.prepare(request)
            return reply_of(None, f"{self.vehicle} is ready")
        refusal = self._follow_problem(following)
        if refusal is not None:
            return reply_of(refusal)
        self._overtake()
        self._follow(following, request.transition_s)
        line = self.plans.ancestors(link.leader for link in following)
        return reply_of(None, self._in_words(following, line))

    def _grounded(self, following: Sequence[LeaderLink]) -> str | None:
        """Return which of the leaders is not in free flight; None for none."""
        for link in following:
            plan = self.plans.newest(link.leader)
            if plan is None or (plan.airborne and plan.followable):
                continue
            status = self.peers.statuses().get(link.leader)
            phase = "on the floor" if not plan.airborne else "not in free flight"
            return f"{link.leader} is {phase}" + (f", its phase is {status.phase}" if status else "")
        return None

    def _follow_problem(self, following: tuple[LeaderLink, ...]) -> str | None:
        for link in following:
            line = self.plans.cycle_through(link.leader)
            if line is not None:
                return f"a cycle: {in_words((self.vehicle, *line))}"
        problem = offset_problem(self.vehicle, following, self.room.now)
        if problem is not None or not self.pilot.guidance.rotor_on:
            return problem
        links, heads = self.peers.formation()
        heads[self.vehicle] = self.pilot.estimate.motion[POSE].copy()
        for link in following:
            plan = self.plans.newest(link.leader)
            if link.leader not in links and plan is not None:
                # Its plan has arrived, its status has not: the end of the plan is its place.
                heads[link.leader] = plan.trajectory.to_numpy()[-1, POSE].copy()
                links = {**links, link.leader: ()}
        return place_problem(self.vehicle, following, links, heads, self.room.now)

    def _follow(self, following: Sequence[LeaderLink], transition_s: float | None) -> None:
        pilot = self.pilot
        links = [followed_leader(link) for link in following]
        plans = self.plans.plans(pilot.clock, self.cycles_from)
        pilot.guidance.follow(links, plans, pilot.estimate, pilot.clock.time_s, transition_s)

    def _in_words(self, following: Sequence[LeaderLink], line: Sequence[str]) -> str:
        """Describe the leaders, and theirs after them in a line."""
        names = [link.leader for link in following]
        if len(names) == 1:
            return in_words((self.vehicle, *line))
        further = [name for name in line if name not in names]
        end = f", who follow {', '.join(further)}" if further else ""
        return f"{self.vehicle} follows {', '.join(names)}{end}"


def reply_of(refusal: str | None, accepted: str = "") -> Reply:
    """Return a reply with the reason of a refusal, or with what was accepted."""
    return Reply(accepted=refusal is None, reason=(accepted if refusal is None else refusal)[:400])
