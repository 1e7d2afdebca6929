"""Answers requests: applies them or says why they are refused. A thread checks the paths of `fly`."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.agents.following.leader_changes import LeaderChanges, reply_of
from rcopterx.agents.following.leader_plans import PeerStatuses, target_link
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.requests.external_control import ExternalControl
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.guard import without_guard
from rcopterx.agents.work_ahead import WorkAhead
from rcopterx.bus import requests
from rcopterx.bus.messages import ZoneSet
from rcopterx.bus.session import Incoming
from rcopterx.control.identification.excitation import Excitation
from rcopterx.control.references.columns import POSE
from rcopterx.control.references.paths import FlightPath, begun_from, path_problem, run_in_time_s
from rcopterx.control.references.set_points import SuspendedPath, TimedPath
from rcopterx.control.references.trajectory import nearest_heading
from rcopterx.formation.placement import move_problem, take_off_problem
from rcopterx.formation.profile_limits import profile_limits_of
from rcopterx.formation.topology import FormationGraph, followers, places
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import Array

CHECKED_EVERY_S: Final = 0.1  # between places of a way that are checked

RoomCheck = Callable[..., str | None]
"""Returns why there is no room for a way, shape (k, 4), or for followers beside it; see `move_problem`."""


def places_along(path: FlightPath, from_s: float, until_s: float) -> Array:
    """Return the places of a part of a path that are checked: x, y, z [m], yaw [rad], shape (k, 4)."""
    return path.sample(np.arange(from_s, until_s + CHECKED_EVERY_S, CHECKED_EVERY_S))[:, POSE]


@dataclass
class TrajectoryRequests:
    """At most one trajectory that is being checked; `refusal` is why none is taken now, if so."""

    pilot: Pilot
    refusal: Callable[[], str | None]
    room_check: Callable[[], RoomCheck]
    wake: Callable[[], None]

    def __post_init__(self) -> None:
        self._work: WorkAhead[str | None] = WorkAhead("trajectory", self.wake)
        self._incoming: Incoming | None = None
        self._path: FlightPath | None = None

    def begin(self, incoming: Incoming, request: requests.Fly) -> None:
        """Begin to check a trajectory, or refuse it."""
        problem = self.refusal()
        if problem is None and self._work.busy:
            problem = "another trajectory is being checked"
        if problem is not None:
            incoming.answer(reply_of(problem))
            return
        path, check = FlightPath(request.knots.to_numpy()), self.room_check()
        self._incoming, self._path = incoming, path
        self._work.begin(lambda: self._problem(path, path.duration_s, check))

    def wait(self) -> None:
        """Wait for the end of the check."""
        self._work.wait()

    def withdraw(self, verb: str) -> None:
        """Refuse the trajectory that is being checked, because a later request was accepted."""
        if self._incoming is not None:
            self._incoming.answer(reply_of(f"overtaken by a later request: {verb}"))
            self._incoming = None

    def finish(self) -> bool:
        """Begin to fly a checked trajectory and reply to its request; return whether there was one."""
        result = self._work.finish()
        incoming, path = self._incoming, self._path
        if result is None or incoming is None or path is None:
            return False
        self._incoming = self._path = None
        problem = result[0] or self.refusal()
        if problem is not None:
            incoming.answer(reply_of(problem))
            return True
        guidance, time_s = self.pilot.guidance, self.pilot.clock.time_s
        present = guidance.task.source.sample(time_s, 1.0, 1).samples[0]
        run_in_s = run_in_time_s(path, present)
        whole = begun_from(path, present, run_in_s)
        problem = self._problem(whole, run_in_s, self.room_check())
        if problem is None:
            guidance.fly(whole, time_s)
        else:
            problem = f"on the way to its beginning, {problem}"
        accepted = f"{whole.duration_s:.1f} s, the first {run_in_s:.1f} s on the way to its beginning"
        incoming.answer(reply_of(problem, accepted))
        return True

    def _problem(self, path: FlightPath, until_s: float, check: RoomCheck) -> str | None:
        """Return why a path leads through a zone, or its first part exceeds limits; None if neither."""
        way = places_along(path, 0.0, path.duration_s)
        return check(way) or path_problem(path, self.pilot.model, until_s)


MOST_IN_A_STEP: Final = 2  # requests that are handled in one step; control comes in between
DEFERRED: Final = "request_deferred"  # counted for every request that had to wait for a later step

_NEEDS_POSE = (requests.TakeOff, requests.Land, requests.GoTo, requests.Fly, requests.Excite)
_CHANGES_REFERENCE = (
    requests.TakeOff,
    requests.Land,
    requests.GoTo,
    requests.Lead,
    requests.Excite,
    requests.CommitLeaders,
    requests.Suspend,
)


@dataclass
class RequestHandler:
    """Requests of one agent."""

    settings: AgentSettings
    pilot: Pilot
    changes: LeaderChanges
    peers: PeerStatuses
    tuning: Tuning
    external: ExternalControl
    wake: Callable[[], None] = lambda: None  # called from the thread that checks trajectories

    def __post_init__(self) -> None:
        self._tuned_by: Incoming | None = None
        self.trajectories = TrajectoryRequests(
            self.pilot,
            lambda: self.changes.promised() or self.pilot.guidance.flight_problem(),
            lambda: self._check_of(*self.peers.formation()),
            self.wake,
        )
        """The trajectory that is being checked."""
        self._at_once: dict[type[requests.Request], Callable[[Any], requests.Reply]] = {
            requests.TakeOff: self._take_off,
            requests.Land: self._land,
            requests.GoTo: self._go_to,
            requests.Lead: self._lead,
            requests.Excite: self._excite,
            requests.TakeControl: self._take_control,
            requests.ReleaseControl: lambda request: reply_of(self.external.release(request.source)),
            requests.CommitLeaders: lambda request: reply_of(self.changes.commit(request)),
            requests.WithdrawLeaders: self._withdraw,
            requests.Suspend: self._suspend,
            requests.Resume: self._suspend,
            requests.SetZones: self._set_zones,
        }
        self._later: dict[type[requests.Request], Callable[[Incoming, Any], None]] = {
            requests.Follow: self.changes.wait,
            requests.PrepareLeaders: self.changes.wait,
            requests.Tune: self._tune,
            requests.Fly: self.trajectories.begin,
        }
        self.waiting: deque[Incoming] = deque()  # requests that wait for the next step
        self.verbs = [requests.verb_of(kind).name for kind in (*self._at_once, *self._later)]
        """Requests that an agent serves."""

    def take(self, incoming: Iterable[Incoming]) -> bool:
        """Handle the oldest requests, as many as fit into one step; return whether there was one."""
        before = len(self.waiting)
        self.waiting.extend(incoming)
        if not self.waiting:
            return False
        for _ in range(min(MOST_IN_A_STEP, len(self.waiting))):
            self.handle(self.waiting.popleft())
        self.pilot.events[DEFERRED] += max(0, len(self.waiting) - max(0, before - MOST_IN_A_STEP))
        return True

    def handle(self, incoming: Incoming) -> None:
        """Reply to a request, now or as soon as its preconditions are known."""
        request = incoming.request
        kind = type(request)
        if kind in _NEEDS_POSE and not self.pilot.ready:
            incoming.answer(reply_of("the motion capture has not seen the vehicle"))
        elif kind in self._later:
            self._later[kind](incoming, request)
        elif kind in self._at_once:
            reply = self._at_once[kind](request)
            if reply.accepted and kind in _CHANGES_REFERENCE:
                self.trajectories.withdraw(incoming.verb)
            incoming.answer(reply)
        else:
            incoming.answer(reply_of(f"an agent does not serve {incoming.verb}"))

    def finish_tuning(self) -> bool:
        """Apply a prepared change and reply to its request; return whether there was one."""
        outcome = self.tuning.finish()
        if outcome is None:
            return False
        if self._tuned_by is not None:
            refusal = str(outcome) if isinstance(outcome, ValueError) else None
            self._tuned_by.answer(reply_of(refusal, str(outcome)))
            self._tuned_by = None
        return True

    def _tune(self, incoming: Incoming, request: requests.Tune) -> None:
        present = self.tuning.configuration
        # Tuning ends the effect of the guard against oscillation.
        wanted = without_guard(present).changed(request)
        refusal = None
        if self.tuning.busy:
            refusal = "another change is being prepared"
        elif self.external.client:
            refusal = f"{self.external.client} flies it from outside"
        elif wanted == present:
            refusal = f"nothing changes: it flies with {present.controller} and {present.estimator} like this"
        if refusal is not None:
            incoming.answer(reply_of(refusal))
        else:
            self.tuning.begin(wanted)
            self._tuned_by = incoming

    def _take_off(self, request: requests.TakeOff) -> requests.Reply:
        guidance = self.pilot.guidance
        if guidance.takes_off_to(request.height_m):
            return reply_of(None)  # The sender repeats a request whose reply was lost.
        floor_m = float(self.pilot.estimate.motion[2])
        top_m = self.changes.room.now.max_m[2]
        if floor_m + request.height_m > top_m:
            return reply_of(
                f"height_m: {request.height_m:g} m is above the flight volume, which ends at {top_m:g} m"
            )
        problem = guidance.take_off_problem() or take_off_problem(
            self.settings.vehicle,
            self.pilot.estimate.motion[:3],
            request.height_m,
            tuple(target_link(link) for link in guidance.task.assigned),
            self.peers.statuses(),
            self.changes.room.now,
        )
        return reply_of(problem or self.pilot.take_off(request.height_m))

    def _land(self, _: requests.Land) -> requests.Reply:
        guidance, place_m = self.pilot.guidance, self.pilot.estimate.motion[:3]
        down = np.array([place_m, (*place_m[:2], guidance.task.floor_m)])
        if guidance.phase is Phase.FLYING and (problem := self.changes.room.now.barred(down)) is not None:
            return reply_of(f"on its way down {problem}")
        return reply_of(guidance.land(self.pilot.estimate, self.pilot.clock.time_s))

    def _go_to(self, request: requests.GoTo) -> requests.Reply:
        position_m, time_s = np.array(request.set_point.position_m), self.pilot.clock.time_s
        # Headings of references have all turns that the vehicle has made.
        near_rad = self.pilot.guidance.heading_rad(time_s)
        yaw_rad = nearest_heading(request.set_point.yaw_rad, near_rad) + math.tau * request.turns
        formation = links, _ = self.peers.formation()
        vehicle, models = self.settings.vehicle, self.settings.models
        limits = profile_limits_of(links, {vehicle: self.pilot.model, **models}, vehicle)
        source = self.pilot.guidance.way_to(position_m, yaw_rad, time_s, limits)
        seconds = source.path.duration_s if isinstance(source, TimedPath) else 0.0
        way = source.sample(time_s, CHECKED_EVERY_S, 2 + int(seconds / CHECKED_EVERY_S)).samples[:, POSE]
        way = np.vstack((self.pilot.estimate.motion[POSE], way))
        check = self._check_of(*formation)
        problem = self.changes.promised() or check(way, unrelated={}) or check(way[-1:])
        return reply_of(problem or self.pilot.guidance.go_to(source))

    def _check_of(self, links: FormationGraph, heads: Mapping[str, Array]) -> RoomCheck:
        """Return the check of a way for the present followers and for vehicles that are not avoided."""
        own, others, room = self.settings.vehicle, {}, self.changes.room.now
        if self.settings.separation is None or self.pilot.step_guard.avoiding is None:
            moved = {own, *followers(links, own)}
            others = {name: at for name, at in places(links, heads).items() if name not in moved}
        return partial(move_problem, own, links=links, heads=heads, room=room, unrelated=others)

    def _lead(self, _: requests.Lead) -> requests.Reply:
        self.changes.lead()
        return reply_of(None, f"{self.settings.vehicle} follows no other vehicle")

    def _withdraw(self, request: requests.WithdrawLeaders) -> requests.Reply:
        self.changes.withdraw(request)
        return reply_of(None)

    def _suspend(self, request: requests.Suspend) -> requests.Reply:
        """Suspend or resume at the frame of the request."""
        guidance, clock = self.pilot.guidance, self.pilot.clock
        problem = guidance.flight_problem() or clock.frame_problem(request.epoch, request.frame)
        if problem is not None:
            return reply_of(problem)
        at_s = clock.time_s + (request.frame - clock.current_frame) * clock.period_s
        if isinstance(request, requests.Resume):
            source = guidance.task.source
            problem = self._barred(source.rest) if isinstance(source, SuspendedPath) else None
            return reply_of(problem or guidance.resume(clock.time_s, at_s), "goes on")
        return reply_of(None, guidance.suspend(self.pilot.estimate, clock.time_s, at_s))

    def _set_zones(self, request: requests.SetZones) -> requests.Reply:
        """Change the keep-out zones, unless another program has changed them since the sender saw them."""
        self.adopt_zones(request.zones)
        same = request.zones == self.changes.room.zones  # as well if a request is repeated
        return reply_of(None if same else "its zones have changed meanwhile, try again")

    def adopt_zones(self, *others: ZoneSet | None) -> None:
        """Adopt the latest zones of these and of other agents; suspend the own way if they bar it."""
        known = [status.zones for status in self.peers.statuses().values()]
        if not self.changes.room.adopt([*others, *known]):
            return
        guidance, time_s = self.pilot.guidance, self.pilot.clock.time_s
        source = guidance.task.source
        if not isinstance(source, TimedPath) or source.finished(time_s):
            return
        if guidance.flight_problem() or guidance.suspended:
            return
        if (problem := self._barred(source.path, time_s - source.start_s)) is not None:
            guidance.remark = f"{guidance.suspend(self.pilot.estimate, time_s, time_s)}: {problem}"

    def _barred(self, path: FlightPath, from_s: float = 0.0) -> str | None:
        """Return why the rest of an accepted path cannot be flown any more, followers beside it; or None."""
        way = places_along(path, from_s, path.duration_s)
        return self._check_of(*self.peers.formation())(way, unrelated={})

    def _excite(self, request: requests.Excite) -> requests.Reply:
        exciter, guidance, clock = self.pilot.exciter, self.pilot.guidance, self.pilot.clock
        if request.duration_s == 0.0:
            exciter.end("ended by request")
            return reply_of(None)
        problem = guidance.flight_problem() or self.changes.promised()
        if self.external.client:
            problem = f"{self.external.client} flies it from outside"
        if guidance.path_left_s(clock.time_s) > 0.0:
            problem = "it flies a trajectory"
        place_m, _ = guidance.set_point()
        around = self.changes.room.now.shrunk(request.reach_m).outside(place_m)
        problem = problem or (around and f"no room for {request.reach_m:g} m around its set point: {around}")
        try:
            excitation = Excitation(request.amplitude, request.duration_s, request.comb)
        except ValueError as error:
            problem = problem or str(error)
        if problem is not None:
            return reply_of(problem)
        exciter.begin(excitation, place_m, request.reach_m, clock.time_s)
        accepted = f"for {request.duration_s:g} s within {request.reach_m:g} m of its set point"
        return reply_of(None, accepted)

    def _take_control(self, request: requests.TakeControl) -> requests.Reply:
        if self.tuning.busy:
            return reply_of("another controller is being prepared")
        refusal = self.external.take(request)
        return reply_of(refusal, f"{request.source} flies {self.settings.vehicle}")
