"""Event-triggered distributed MPC that survives lost messages (after DMPC-Swarm, Graefe et al. 2025).

In each round every vehicle announces its path and how urgently it needs another one. The few most urgent
vehicles plan one that begins with the next round, within planes between all paths at all stages, of which
each side keeps a half; the others fly on, so that messages and computing stay few. A vehicle plans only if
the messages of all vehicles near it arrived in the last round: otherwise its path stays, which the others
have respected. So a lost message costs time and no separation (arXiv 2508.20553).
"""

from collections.abc import Sequence
from typing import Annotated, Final

import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from rcopterx.control.interfaces import Estimate
from rcopterx.control.scheme import Situation
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array
from rcopterx_studies.schemes.replanning import Announced, ReplanningScheme, ReplanningSettings
from rcopterx_studies.schemes.tracked import SchemePath

NEAR: Final = 8.0  # distance in ellipsoids up to which vehicles get planes, and have to be received
LISTENING: Final = 2  # rounds in which a vehicle only listens at first


class EventTriggeredSettings(ReplanningSettings, frozen=True, kw_only=True):
    """Settings of the scheme."""

    planning: Annotated[int, Meta(ge=1, le=64)] = 3
    """Number of vehicles that plan in a round."""
    trigger_m: float = 0.01
    """Distance between path and targets from which a vehicle needs another path."""


class EventTriggeredScheme(ReplanningScheme[EventTriggeredSettings]):
    """Plans in turns; the cascade tracks the path."""

    Settings = EventTriggeredSettings
    end = "rest"

    def __init__(self, model: Model, period_s: float, settings: EventTriggeredSettings) -> None:
        super().__init__(model, period_s, settings)
        self._next: Announced | None = None  # announced path that begins with the next round
        self._priority = 0.0
        self._waited = 0  # rounds since the vehicle planned, or since it began to listen
        self._planned = False

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle."""
        super().reset(estimate, last_input)
        self._next, self._waited, self._planned = None, 0, False

    def _plan_round(self, situation: Situation) -> Announced:
        if self._next is not None:
            path = SchemePath.unpacked(self._next.path, self._next.stage_s)
            self._fly(path, self._next.begins_s)
            self._next = None
        begins_s = (self._round + 1) * self._settings.round_s
        times_s = begins_s + self._stage_times_s
        others, own = self._others(situation, times_s), self._own(times_s)
        targets = self._targets(situation, others, begins_s)
        distances = self._distances(own, others)
        near = [name for name, each in distances.items() if each.min() < NEAR]
        self._waited += 1
        error_m = float(np.abs(own - targets).max())
        before, self._priority = self._priority, error_m * self._waited
        turn = self._planned or self._waited > LISTENING
        if error_m > self._settings.trigger_m and turn and self._has_turn(situation, before, near):
            planes = [
                self._plane(stage, own, others[name], halved=True)
                for name in near
                for stage in range(1, self._settings.stages)
                if distances[name][stage] < NEAR
            ]
            path = self._plan(*self._state(begins_s), targets, planes)
            self._next = Announced(begins_s, path.packed(), path.stage_s)
            self._waited, self._planned = 0, True
        return replace(self._next or self._announce(), priority=self._priority)

    def _has_turn(self, situation: Situation, priority: float, near: Sequence[str]) -> bool:
        """Whether the messages of all near vehicles arrived in the last round, and few are more urgent."""
        neighbours = situation.neighbours
        if any(neighbours[name].age_s > 1.5 * self._settings.round_s for name in near):
            return False
        rivals = [
            (each.message.priority, name)
            for name, each in neighbours.items()
            if isinstance(each.message, Announced)
        ]
        return sum(rival > (priority, situation.vehicle) for rival in rivals) < self._settings.planning
