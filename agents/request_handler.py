"""Answers requests to one agent: checks what is asked, hands it to the pilot, says why not."""

from collections.abc import Callable
from typing import Any

import numpy as np

from rcopterx.agents.external_control import ExternalControl
from rcopterx.agents.following.leader_changes import LeaderChanges, reply_of
from rcopterx.agents.following.links import target_link
from rcopterx.agents.following.peers import PeerStatuses
from rcopterx.agents.formation.limit_scaling import turn_limits_of
from rcopterx.agents.formation.placement import Room, move_problem, take_off_problem
from rcopterx.agents.formation.present import formation_of
from rcopterx.agents.formation.topology import FormationGraph, followers, places
from rcopterx.agents.identification.excitation import Excitation
from rcopterx.agents.interfaces import AvoidsObstacles
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.references.paths import FlightPath, begun_from, path_problem, run_in_time_s
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.guard import without_guard
from rcopterx.bus.requests import (
    CommitLeaders,
    Excite,
    Fly,
    Follow,
    GoTo,
    Land,
    Lead,
    PrepareLeaders,
    ReleaseControl,
    Request,
    TakeControl,
    TakeOff,
    Tune,
    WithdrawLeaders,
    verb_of,
)
from rcopterx.bus.session import Incoming
from rcopterx.vehicles.state import Array

Decision = tuple[str | None, str]
"""Why a request is refused, or None and what happens."""

CHECKED_EVERY_S = 0.1
"""Time between the moments of a trajectory at which the places of followers are checked."""

_NEEDS_POSE = (TakeOff, Land, GoTo, Fly, Excite)


class RequestHandler:
    """Requests of one agent.

    Parameters
    ----------
    settings, pilot, room, changes, peers, tuning, external
        The agent's own.

    Attributes
    ----------
    verbs
        Requests that an agent serves.
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        room: Room,
        changes: LeaderChanges,
        peers: PeerStatuses,
        tuning: Tuning,
        external: ExternalControl,
    ) -> None:
        self._settings = settings
        self._pilot = pilot
        self._tuning = tuning
        self._external = external
        self._tuned_by: Incoming | None = None
        self._room = room
        self._changes = changes
        self._peers = peers
        self._at_once: dict[type[Request], Callable[[Any], Decision]] = {
            TakeOff: self._take_off,
            Land: self._land,
            GoTo: self._go_to,
            Fly: self._fly,
            Lead: self._lead,
            Excite: self._excite,
            TakeControl: self._take_control,
            ReleaseControl: lambda request: (self._external.release(request.source), ""),
            CommitLeaders: lambda request: (self._changes.commit(request), ""),
            WithdrawLeaders: self._withdraw,
        }
        self._later: dict[type[Request], Callable[[Incoming, Any], None]] = {
            Follow: self._changes.wait,
            PrepareLeaders: self._changes.wait,
            Tune: self._tune,
        }
        self.verbs = [verb_of(kind).name for kind in (*self._at_once, *self._later)]

    def handle(self, incoming: Incoming) -> None:
        """Answer a request, now or as soon as what it depends on is known."""
        request = incoming.request
        kind = type(request)
        if kind in self._later:
            self._later[kind](incoming, request)
        elif kind not in self._at_once:
            incoming.answer(reply_of(f"an agent does not serve {incoming.verb}", ""))
        elif kind in _NEEDS_POSE and not self._pilot.ready:
            incoming.answer(reply_of("the motion capture has not seen the vehicle", ""))
        else:
            incoming.answer(reply_of(*self._at_once[kind](request)))

    def settle_tuning(self) -> bool:
        """Let what was prepared take over, and answer who asked for it; True if there was something."""
        outcome = self._tuning.finish()
        if outcome is None:
            return False
        if self._tuned_by is not None:
            refused = isinstance(outcome, ValueError)
            self._tuned_by.answer(
                reply_of(str(outcome) if refused else None, "" if refused else str(outcome))
            )
            self._tuned_by = None
        return True

    def _tune(self, incoming: Incoming, request: Tune) -> None:
        refusal = self._tuning_problem(request)
        if refusal is not None:
            incoming.answer(reply_of(refusal, ""))
        else:
            self._tuned_by = incoming

    def _tuning_problem(self, request: Tune) -> str | None:
        if self._tuning.busy:
            return "another change is being prepared"
        if self._external.client:
            return f"{self._external.client} flies it from outside"
        present = self._tuning.configuration
        # Who tunes a vehicle ends what the guard against oscillation did to it.
        wanted = without_guard(present).changed(
            request.controller, request.controller_settings, request.estimator, request.estimator_settings
        )
        if wanted == present:
            return f"nothing changes: it flies with {present.controller} and {present.estimator} like this"
        self._tuning.begin(wanted)
        return None

    def _take_off(self, request: TakeOff) -> Decision:
        floor_m = float(self._pilot.estimate.motion[2])
        top_m = self._settings.volume_max_m[2]
        if floor_m + request.height_m > top_m:
            return (
                f"height_m: {request.height_m:g} m is above the flight volume, which ends at {top_m:g} m",
                "",
            )
        guidance = self._pilot.guidance
        problem = guidance.take_off_problem() or take_off_problem(
            self._settings.vehicle,
            self._pilot.estimate.motion[:3],
            request.height_m,
            tuple(target_link(link) for link in guidance.assigned),
            self._peers.statuses(),
            self._room,
        )
        return problem or self._pilot.take_off(request.height_m), ""

    def _land(self, _: Land) -> Decision:
        return self._pilot.guidance.land(self._pilot.estimate, self._pilot.clock.time_s), ""

    def _go_to(self, request: GoTo) -> Decision:
        position_m, yaw_rad = np.array(request.set_point.position_m), request.set_point.yaw_rad
        problem = (
            self._changes.promised()
            or self._room.outside(position_m)
            or self._formation_problem(np.array([[*position_m, yaw_rad]]))
        )
        if problem is not None:
            return problem, ""
        vehicle, models = self._settings.vehicle, self._settings.models
        turn = turn_limits_of(self._formation()[0], {vehicle: self._pilot.model, **models}, vehicle)
        return self._pilot.guidance.go_to(position_m, yaw_rad, self._pilot.clock.time_s, turn), ""

    def _fly(self, request: Fly) -> Decision:
        guidance, time_s = self._pilot.guidance, self._pilot.clock.time_s
        problem = self._changes.promised() or guidance.flight_problem()
        if problem is not None:
            return problem, ""
        present = guidance.source.sample(time_s, 1.0, 1).samples[0]
        wanted = FlightPath(request.knots.to_numpy())
        run_in_s = run_in_time_s(wanted, present)
        path = begun_from(wanted, present, run_in_s)
        problem = path_problem(
            path, self._pilot.model, self._settings.volume_min_m, self._settings.volume_max_m
        ) or self._formation_problem(
            path.sample(np.arange(0.0, path.duration_s + CHECKED_EVERY_S, CHECKED_EVERY_S))
        )
        if problem is not None:
            return problem, ""
        guidance.fly(path, time_s)
        return None, f"{path.duration_s:.1f} s, the first {run_in_s:.1f} s on the way to its beginning"

    def _formation(self) -> tuple[FormationGraph, dict[str, Array]]:
        """Who follows whom, and where those are that follow nobody, by the statuses of the others."""
        return formation_of(self._peers.statuses(), flying=(self._settings.vehicle,))

    def _formation_problem(self, samples: Array) -> str | None:
        """Who of those that follow would leave the volume, or come too close to somebody not avoided."""
        own = self._settings.vehicle
        links, heads = self._formation()
        others = {}
        if self._settings.separation is None or not isinstance(self._pilot.controller, AvoidsObstacles):
            moved = {own, *followers(links, own)}
            others = {name: at for name, at in places(links, heads).items() if name not in moved}
        return move_problem(own, samples, links, self._room, others)

    def _lead(self, _: Lead) -> Decision:
        self._changes.lead()
        return None, f"{self._settings.vehicle} follows nobody"

    def _withdraw(self, request: WithdrawLeaders) -> Decision:
        self._changes.withdraw(request)
        return None, ""

    def _excite(self, request: Excite) -> Decision:
        exciter, guidance, clock = self._pilot.exciter, self._pilot.guidance, self._pilot.clock
        if request.duration_s == 0.0:
            exciter.end("ended by request")
            return None, ""
        problem = guidance.flight_problem() or self._changes.promised()
        if self._external.client:
            problem = f"{self._external.client} flies it from outside"
        if guidance.path_left_s(clock.time_s) > 0.0:
            problem = "it flies a trajectory"
        place_m, _ = guidance.set_point()
        for corner_m in (place_m - request.reach_m, place_m + request.reach_m):
            problem = problem or self._room.outside(corner_m)
        try:
            excitation = Excitation(request.amplitude, request.duration_s)
        except ValueError as error:
            problem = problem or str(error)
        if problem is not None:
            return problem, ""
        exciter.begin(excitation, place_m, request.reach_m, clock.time_s)
        return None, f"for {request.duration_s:g} s within {request.reach_m:g} m of its set point"

    def _take_control(self, request: TakeControl) -> Decision:
        if self._tuning.busy:
            return "another controller is being prepared", ""
        return self._external.take(request), f"{request.source} flies {self._settings.vehicle}"
