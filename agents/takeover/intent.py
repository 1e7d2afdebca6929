"""Intents: the task of an agent as a message, and a message as the task of its successor."""

from typing import Final

import numpy as np

from rcopterx.agents.flight.followed import FollowedLeader
from rcopterx.agents.flight.task import Task
from rcopterx.agents.following.links import followed_leader, target_link
from rcopterx.agents.formation.law import FormationOffset
from rcopterx.agents.phases import Phase
from rcopterx.agents.tuning.configuration import Configuration, settings_in_message
from rcopterx.bus.intent import FlownBy, Intent, OffsetMove
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import SetPoint
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.set_points import (
    PathReference,
    ReferenceSource,
    SetPointReference,
    TimedPath,
)
from rcopterx.vehicles.tuples import three

_END_OF_TIME_S: Final = 1e9


def intent_of(
    lease: int,
    task: Task,
    configuration: Configuration,
    previous: Configuration | None,
    epoch: int,
    frame: int,
    time_s: float,
    yaw_rad: float | None,
) -> Intent:
    """Return the task of a vehicle as a message; `task_of` makes the same task of it at any later moment.

    Parameters
    ----------
    configuration, previous
        Controller and estimator, and those before the last change.
    epoch, frame, time_s
        Present moment, on the fleet's clock and on the vehicle's.
    yaw_rad
        Present heading with all its turns; None before the vehicle has been seen.
    """
    path = task.source if isinstance(task.source, TimedPath) else None
    end = task.source.sample(_END_OF_TIME_S, 1.0, 2)
    return Intent(
        lease=lease,
        phase=task.phase.value,
        epoch=epoch,
        frame=frame,
        yaw_rad=yaw_rad,
        set_point=SetPoint(position_m=three(end.position_m[0]), yaw_rad=float(end.yaw_rad[0])),
        path=None if path is None else FloatArray.of(path.path.knots),
        path_elapsed_s=0.0 if path is None else time_s - path.start_s,
        floor_m=task.floor_m,
        interrupted=None if task.interrupted is None else task.interrupted.value,
        assigned=tuple(target_link(link) for link in task.assigned),
        following=tuple(link.leader for link in task.followed),
        joined=tuple(sorted(task.joined)),
        moves=tuple(
            OffsetMove(
                leader=link.leader,
                start_offset_m=three(link.start.position_m),
                start_yaw_offset_rad=link.start.yaw_rad,
                elapsed_s=time_s - link.start_s,
                duration_s=link.duration_s,
            )
            for link in task.followed
            if link.start is not None and time_s < link.start_s + link.duration_s
        ),
        controller=configuration.controller,
        controller_settings=settings_in_message(configuration.controller_settings),
        estimator=configuration.estimator,
        estimator_settings=settings_in_message(configuration.estimator_settings),
        previous=None if previous is None else _flown_by(previous),
    )


def _flown_by(configuration: Configuration) -> FlownBy:
    return FlownBy(
        controller=configuration.controller,
        controller_settings=settings_in_message(configuration.controller_settings),
        estimator=configuration.estimator,
        estimator_settings=settings_in_message(configuration.estimator_settings),
    )


def task_of(intent: Intent, time_s: float, passed_s: float) -> Task:
    """Return the task of a predecessor, `passed_s` after its publication, on the clock of its successor."""
    published_s = time_s - passed_s
    source: ReferenceSource = SetPointReference(
        np.array(intent.set_point.position_m), intent.set_point.yaw_rad
    )
    if intent.path is not None:
        source = PathReference(FlightPath(intent.path.to_numpy()), published_s - intent.path_elapsed_s)
    assigned = followed = tuple(followed_leader(link) for link in intent.assigned)
    joined: frozenset[str] = frozenset()
    if intent.following == tuple(link.leader for link in assigned):
        moves = {move.leader: move for move in intent.moves}
        followed = tuple(_moving(link, moves.get(link.leader), published_s) for link in assigned)
        joined = frozenset(intent.joined)
    # Else others replaced lost leaders; the successor decides again whether they still have to.
    interrupted = None if intent.interrupted is None else Phase(intent.interrupted)
    return Task(Phase(intent.phase), source, followed, assigned, joined, intent.floor_m, interrupted)


def configuration_of(flown: Intent | FlownBy) -> Configuration:
    """Return controller and estimator of a predecessor."""
    return Configuration(
        flown.controller, flown.estimator, flown.controller_settings, flown.estimator_settings
    )


def passed_s(intent: Intent, age_s: float, epoch: int, frame: int, period_s: float) -> float:
    """Return the time since an intent was published: by frames, across epochs by its age."""
    return (frame - intent.frame) * period_s if epoch == intent.epoch else age_s


def _moving(link: FollowedLeader, move: OffsetMove | None, published_s: float) -> FollowedLeader:
    if move is None:
        return link
    start = FormationOffset(np.array(move.start_offset_m), move.start_yaw_offset_rad, link.target.frame)
    return FollowedLeader(
        link.leader, link.target, link.weight, start, published_s - move.elapsed_s, move.duration_s
    )
