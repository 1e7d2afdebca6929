"""Requests to fly a trajectory, which a thread checks: that takes longer than a control period."""

from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.agents.following.leader_changes import reply_of
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.work_ahead import WorkAhead
from rcopterx.bus.requests import Fly
from rcopterx.bus.session import Incoming
from rcopterx.control.references.paths import FlightPath, begun_from, path_problem, run_in_time_s
from rcopterx.vehicles.state import Array

CHECKED_EVERY_S: Final = 0.1
"""Time between the moments of a trajectory at which the places of followers are checked."""

FormationCheck = Callable[[Array], str | None]
"""Returns why followers cannot come along on a way, shape (k, 4 or more); None if they can."""


class TrajectoryRequests:
    """At most one trajectory that is being checked; the way to its beginning is checked when it begins.

    Parameters
    ----------
    refusal
        Why no trajectory is taken now, None if one is.
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        refusal: Callable[[], str | None],
        formation_check: Callable[[], FormationCheck],
        wake: Callable[[], None],
    ) -> None:
        self._settings, self._pilot = settings, pilot
        self._refusal, self._formation_check = refusal, formation_check
        self._work: WorkAhead[str | None] = WorkAhead("trajectory", wake)
        self._incoming: Incoming | None = None
        self._path: FlightPath | None = None

    def begin(self, incoming: Incoming, request: Fly) -> None:
        """Begin to check a trajectory, or refuse it."""
        problem = self._refusal()
        if problem is None and self._work.busy:
            problem = "another trajectory is being checked"
        if problem is not None:
            incoming.answer(reply_of(problem))
            return
        path, formation = FlightPath(request.knots.to_numpy()), self._formation_check()
        self._incoming, self._path = incoming, path
        self._work.begin(lambda: self._problem(path, path.duration_s, formation))

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
        problem = result[0] or self._refusal()
        if problem is not None:
            incoming.answer(reply_of(problem))
            return True
        guidance, time_s = self._pilot.guidance, self._pilot.clock.time_s
        present = guidance.source.sample(time_s, 1.0, 1).samples[0]
        run_in_s = run_in_time_s(path, present)
        whole = begun_from(path, present, run_in_s)
        problem = self._problem(whole, run_in_s, self._formation_check())
        if problem is None:
            guidance.fly(whole, time_s)
        else:
            problem = f"on the way to its beginning, {problem}"
        incoming.answer(
            reply_of(
                problem, f"{whole.duration_s:.1f} s, the first {run_in_s:.1f} s on the way to its beginning"
            )
        )
        return True

    def _problem(self, path: FlightPath, until_s: float, formation: FormationCheck) -> str | None:
        """Return why the first part of a path cannot be flown; None if it can."""
        settings = self._settings
        return path_problem(
            path, self._pilot.model, settings.volume_min_m, settings.volume_max_m, until_s
        ) or formation(path.sample(np.arange(0.0, until_s + CHECKED_EVERY_S, CHECKED_EVERY_S)))
