"""A change of leaders of several vehicles in one operation: all of them at the same frame, or none.

This is a two-phase commit. Every vehicle checks and prepares the change first; only then the commits with the
frame of the change are sent. The frame lies far enough ahead to withdraw the change if a commit fails.
Commits go to leaders before their followers, so that no cycle appears even if this program dies in between.
"""

import math
import uuid
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress

import numpy as np

from rcopterx.bus.messages import AgentStatus, LeaderLink, Plan, SetPoint
from rcopterx.bus.requests import CommitLeaders, PrepareLeaders, Request, Suspend, WithdrawLeaders
from rcopterx.bus.session import RequestFailedError
from rcopterx.formation import topology
from rcopterx.formation.placement import Room
from rcopterx.formation.shapes import formation_links
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.vehicles.state import Array, turned_about_z

LEAD_TIME_S = 0.4  # from the first commit to the frame of the change; for every vehicle a little longer
LEAD_TIME_PER_VEHICLE_S = 0.03
COMMIT_LIMIT_S = 0.15  # for an answer to a commit, so that there is time to withdraw the change
CHANGED_LIMIT_S = 2.0

Change = Mapping[str, tuple[LeaderLink, ...]]


def swapped(statuses: Mapping[str, AgentStatus], first: str, second: str) -> tuple[Change, dict[str, Array]]:
    """New leaders when two vehicles exchange roles, and all places; RefusedError if one does not fly."""
    links, heads = topology.formation_of(statuses)
    where = topology.places(links, heads)
    for name in (first, second):
        _expect_flying(statuses, name)
    try:
        return topology.exchanged(links, where, first, second), where
    except topology.TopologyError as error:
        raise RefusedError(str(error)) from None


def _expect_flying(statuses: Mapping[str, AgentStatus], name: str) -> None:
    if name not in statuses:
        raise RefusedError(f"{name} is absent: its agent is silent")
    if statuses[name].phase != "flying":
        raise RefusedError(f"{name} does not fly, its phase is {statuses[name].phase}")


def role(links: Sequence[LeaderLink]) -> str:
    """Role of a vehicle with these leaders, in words."""
    return f"follows {', '.join(link.leader for link in links)}" if links else "leads"


def formation_leader(statuses: Mapping[str, AgentStatus], name: str) -> str:
    """The leader of a vehicle's formation; RefusedError if it does not fly, leads, or has several."""
    _expect_flying(statuses, name)
    links, _ = topology.formation_of(statuses)
    heads = topology.roots(links, name)
    if not heads:
        raise RefusedError(f"the leaders of {name} are changing; try again")
    if heads == (name,):
        raise RefusedError(f"{name} leads already")
    if len(heads) > 1:
        lines = "; ".join(topology.in_words(topology.line_between(links, name, head)) for head in heads)
        raise RefusedError(f"{name} has several leaders at the head: {lines}; name one of them to swap with")
    return heads[0]


def shaped(
    statuses: Mapping[str, AgentStatus], shape: str, leader: str, spacing_m: float, room: Room, assign: bool
) -> dict[str, LeaderLink]:
    """Links of all that fly in a formation behind a leader; RefusedError: it cannot lead, or has no room."""
    _expect_flying(statuses, leader)
    links, heads = topology.formation_of(statuses)
    if links[leader]:
        raise RefusedError(f"{leader} {role(links[leader])}; let it lead first")
    where = topology.places(links, heads)
    names = [name for name in sorted(where) if name != leader and statuses[name].phase == "flying"]
    present_m = None
    if assign:
        beside = [turned_about_z((where[name] - where[leader])[:3], -where[leader][3]) for name in names]
        present_m = np.array(beside).reshape(-1, 3)
    found = formation_links(shape, leader, names, spacing_m, present_m)
    for name, link in found.items():
        if (problem := room.outside(topology.station((link,), (where[leader],)))) is not None:
            raise RefusedError(f"no place for {name}: {problem}")
    return found


def regroup(
    fleet: Observer, change: Change, where: Mapping[str, Array], before: Change | None = None
) -> None:
    """Carry out a change of leaders at one frame.

    `where` has the places of vehicles that shall lead. `before` are the present leaders: they are restored if
    a vehicle fails between the commit and its frame. Raises `RefusedError`: says who, and what has changed.
    """
    operation = f"regroup_{uuid.uuid4().hex[:8]}"
    uncommitted, committing = list(change), False
    try:
        for name, following in change.items():
            _request(fleet, name, _preparation(operation, following, where.get(name)))
        epoch, frame = _frame_ahead(fleet, change)
        committing = True
        for name in change:
            commit = CommitLeaders(operation=operation, epoch=epoch, frame=frame)
            _request(fleet, name, commit, timeout_s=COMMIT_LIMIT_S, patience_s=0.0)
            uncommitted.remove(name)
    except (RefusedError, RequestFailedError) as error:
        silent = _withdraw(fleet, operation, list(change))
        # Vehicles without a commit keep their leaders. The first of them may have received its commit.
        unsure = [name for name in silent if name not in uncommitted[1:]] if committing else []
        outcome = (
            f"did not confirm to keep their leaders: {', '.join(unsure)}" if unsure else "nothing has changed"
        )
        raise RefusedError(f"{error}; {outcome}") from None
    late = _wait_until_changed(fleet, change)
    if late and before is not None:
        regroup(fleet, {name: before[name] for name in change if name not in late}, where)
        raise RefusedError(f"{', '.join(late)} did not change leaders; all vehicles are as before")
    if late:
        raise RefusedError(f"{', '.join(late)} did not change leaders")


def _frame_ahead(fleet: Observer, names: Collection[str]) -> tuple[int, int]:
    """Return epoch and number of a frame that lies ahead when the last of these vehicles has answered."""
    newest = max((_plan(fleet, name) for name in names), key=lambda plan: (plan.epoch, plan.frame))
    lead_s = LEAD_TIME_S + LEAD_TIME_PER_VEHICLE_S * len(names)
    return newest.epoch, newest.frame + math.ceil(lead_s / fleet.frame_period_s(newest.source))


def pause(fleet: Observer, kind: type[Suspend]) -> list[str]:
    """Let all vehicles that fly and lead suspend or resume their paths at one frame; see `Fleet.suspend`."""
    statuses = fleet.statuses()
    leading = [name for name, each in statuses.items() if each.phase == "flying" and not each.assigned]
    if not leading:
        raise RefusedError("no vehicle that leads is in the air")
    epoch, frame = _frame_ahead(fleet, leading)
    lines, accepted = [], False
    for name in leading:
        request = kind(epoch=epoch, frame=frame)
        try:
            lines.append(f"{name}: {_request(fleet, name, request, timeout_s=COMMIT_LIMIT_S, patience_s=0)}")
            accepted = True
        except (RefusedError, RequestFailedError) as error:  # The frame comes for the others.
            lines.append(str(error))
    if not accepted:
        raise RefusedError("; ".join(lines))
    return lines


def _preparation(operation: str, following: tuple[LeaderLink, ...], place: Array | None) -> PrepareLeaders:
    if following:
        return PrepareLeaders(operation=operation, following=following)
    if place is None:
        raise RefusedError("the place of the new leader is not known")
    x, y, z, yaw_rad = place.tolist()
    return PrepareLeaders(operation=operation, set_point=SetPoint(position_m=(x, y, z), yaw_rad=yaw_rad))


def _request(fleet: Observer, name: str, request: Request, **limits: float) -> str:
    reply = fleet.session.request(name, request, **limits)
    if not reply.accepted:
        raise RefusedError(f"{name}: {reply.reason}")
    return reply.reason


def _withdraw(fleet: Observer, operation: str, names: Sequence[str]) -> list[str]:
    """Withdraw a change; return the vehicles that did not confirm it."""
    silent = []
    for name in names:
        try:
            withdrawal = WithdrawLeaders(operation=operation)
            _request(fleet, name, withdrawal, timeout_s=COMMIT_LIMIT_S, patience_s=0.0)
        except (RefusedError, RequestFailedError):
            silent.append(name)
    return silent


def _plan(fleet: Observer, name: str) -> Plan:
    if (plan := fleet.plan_of(name)) is None:
        raise RefusedError(f"{name}: no plan arrives")
    return plan


def _wait_until_changed(fleet: Observer, change: Change) -> list[str]:
    """Vehicles that do not follow their new leaders in time."""

    def missing() -> list[str]:
        return [
            name
            for name, following in change.items()
            if {link.leader for link in _plan(fleet, name).following} != {link.leader for link in following}
        ]

    with suppress(TimeoutError):
        fleet.wait_until(lambda: not missing(), CHANGED_LIMIT_S, "leaders not changed")
    return missing()
