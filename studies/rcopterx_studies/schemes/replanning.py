"""What schemes share that plan a new path every few tenths of a second, clear of the paths of others.

Ways are announced by messages. A vehicle with a task of its own plans towards its reference, a vehicle that
follows towards the announced paths of its leaders plus its offsets.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal, TypeVar

import numpy as np
from msgspec import Meta, Struct

from rcopterx.control.interfaces import Estimate
from rcopterx.control.scheme import Situation
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array
from rcopterx_studies.schemes.messages import Samples, linked
from rcopterx_studies.schemes.planner import Plane, WayPlanner
from rcopterx_studies.schemes.tracked import INSTANT_S, Gain, SchemePath, TrackedScheme, TrackedSettings


class ReplanningSettings(TrackedSettings, frozen=True, kw_only=True):
    """Settings of schemes that plan in rounds."""

    round_s: Annotated[float, Meta(ge=0.02, le=1.0)] = 0.2
    stages: Annotated[int, Meta(ge=2, le=50)] = 20
    stage_s: Annotated[float, Meta(ge=0.02, le=0.5)] = 0.1
    position_weight: Gain = 1.0
    effort_weight: Gain = 0.02
    horizontal_m: Gain = 0.4
    vertical_m: Gain = 0.7
    """Half axes of the ellipsoid around a vehicle that others do not enter."""
    passing: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.6
    """How far planes between vehicles that meet turn, so that these pass each other on the right."""


class Announced(Struct, frozen=True):
    """Path of the sender; raises `ValueError` without position and velocity, also when it is decoded."""

    begins_s: float  # time of the fleet's clock at which the path begins
    path: Samples
    stage_s: float
    priority: float = 0.0  # how urgently the sender needs a new path

    def __post_init__(self) -> None:
        if len(self.path) < 2:
            raise ValueError("a path needs a position and a velocity")

    def at(self, times_s: Array) -> Array:
        """Positions at some times of the fleet's clock, shape (n, 3)."""
        return SchemePath.unpacked(self.path, self.stage_s).at(times_s - self.begins_s)[0]


R = TypeVar("R", bound=ReplanningSettings)


class ReplanningScheme(TrackedScheme[R]):
    """A scheme that plans and announces paths in rounds of the fleet's clock."""

    Message = Announced
    end: ClassVar[Literal["cost_to_go", "rest"]] = "cost_to_go"

    def __init__(self, model: Model, period_s: float, settings: R) -> None:
        super().__init__(model, period_s, settings)
        self._axes = np.array((settings.horizontal_m, settings.horizontal_m, settings.vertical_m))
        self._stage_times_s: Array = settings.stage_s * np.arange(settings.stages + 1.0)
        self._planner = WayPlanner(
            settings.stages, settings.stage_s, self._reach, self._speed,
            settings.position_weight, settings.effort_weight, planes=8, end=self.end,
        )  # fmt: skip
        self._round = -1

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle."""
        super().reset(estimate, last_input)
        self._round = -1

    def _exchange(self, situation: Situation) -> Announced | None:
        current = int(situation.time_s / self._settings.round_s + INSTANT_S)
        if current == self._round:
            return None
        self._round = current
        return self._plan_round(situation)

    @abstractmethod
    def _plan_round(self, situation: Situation) -> Announced:
        """Plan at the beginning of a round; return the message."""

    def _others(self, situation: Situation, times_s: Array) -> dict[str, Array]:
        """Announced positions of other vehicles at some times, shape (n, 3) each."""
        received = sorted(situation.neighbours.items())
        messages = {name: neighbour.message for name, neighbour in received}
        return {name: each.at(times_s) for name, each in messages.items() if isinstance(each, Announced)}

    def _targets(self, situation: Situation, others: Mapping[str, Array], start_s: float) -> Array:
        """Where to be at the stages of a path that begins at a time, shape (K + 1, 3)."""
        if not situation.follows:
            given, ahead_s = self._settings, start_s - situation.time_s
            return situation.reference.resampled(ahead_s, given.stage_s, given.stages + 1).position_m
        followed = [link for link in linked(situation, Announced) if link.followed]
        if not followed:
            return self._own(start_s + self._stage_times_s)
        return np.asarray(np.mean([others[link.name] + link.offset_m for link in followed], axis=0))

    def _own(self, times_s: Array) -> Array:
        """Positions of the present path at some times, shape (n, 3)."""
        assert self._path is not None
        return self._path.at(times_s - self._began_s)[0]

    def _plan(self, position: Array, velocity: Array, targets: Array, planes: Sequence[Plane]) -> SchemePath:
        """Plan a path, which ends at rest."""
        path = self._planner.plan(position, velocity, targets, planes)
        _, last, _ = path.at(self._stage_times_s[-1:])
        return path.braked(last[0])

    def _distances(self, own: Array, others: Mapping[str, Array]) -> dict[str, Array]:
        """Distances to others in ellipsoids, 1 where they touch, shape (n,) each."""
        return {name: np.linalg.norm((own - paths) / self._axes, axis=1) for name, paths in others.items()}

    def _plane(self, stage: int, own: Array, other: Array, halved: bool) -> Plane:
        """Plane that separates two paths at a stage, on the ellipsoid of the other one.

        If `halved`, the room between the paths belongs to the nearer one, so that both may plan at the same
        time. The plane turns so that vehicles which meet pass each other on the right.
        """
        gaps = (own - other) / self._axes
        gap, change = gaps[stage], gaps[-1] - gaps[0]
        turn = self._settings.passing * float(np.clip(2.0 - _length(gap), 0.0, 1.0))
        right = turn * np.array((change[1], -change[0], 0.0)) / max(_length(change), 1e-6)
        gap = gap / max(_length(gap), 1e-6) + right
        normal = gap / max(_length(gap), 1e-6) / self._axes
        apart = float(normal @ (own[stage] - other[stage])) if halved else 1.0
        return Plane(stage, normal, float(normal @ other[stage]) + max(1.0, 0.5 + 0.5 * apart))

    def _announce(self) -> Announced:
        assert self._path is not None
        return Announced(self._began_s, self._path.packed(), self._path.stage_s)


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))
