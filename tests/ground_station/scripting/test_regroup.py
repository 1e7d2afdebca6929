"""Promises of changing leaders together: all or none, also when a vehicle refuses, falls silent or dies."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.plans import plan_of
from support.statuses import hovering

from rcopterx.bus.messages import AgentStatus, LeaderLink, Plan, SetPoint, Zone
from rcopterx.bus.requests import CommitLeaders, PrepareLeaders, Reply, Request, Suspend, WithdrawLeaders
from rcopterx.bus.session import RequestFailedError
from rcopterx.formation.placement import Room
from rcopterx.formation.topology import cycle
from rcopterx.ground_station.scripting.regroup import (
    formation_leader,
    pause,
    regroup,
    shaped,
    swapped,
)
from rcopterx.ground_station.scripting.vehicle import RefusedError

ROOM = Room((-2.0, -2.0, 0.0), (2.0, 2.0, 2.0))
FormationGraph = dict[str, tuple[LeaderLink, ...]]


def link(leader: str, x: float) -> LeaderLink:
    return LeaderLink(leader=leader, offset_m=(x, 0.0, 0.0))


TREE: FormationGraph = {
    "h1": (),
    "h2": (link("h1", -0.5),),
    "h3": (link("h1", 0.5),),
    "h4": (link("h3", 0.5),),
}


def status(following: tuple[LeaderLink, ...], place: float = 0.0, phase: str = "flying") -> AgentStatus:
    return hovering((place, 0.0, 1.0), *following, phase=phase)


STATUSES = {name: status(links) for name, links in TREE.items()}


@dataclass
class Member:
    """A vehicle as far as a change of leaders goes."""

    following: tuple[LeaderLink, ...]
    prepared: PrepareLeaders | None = None
    frame: int | None = None
    alive: bool = True


@dataclass
class Formation:
    """A fleet whose frames pass during waits; trouble comes at the number of a request."""

    members: dict[str, Member]
    trouble: dict[int, str] = field(default_factory=dict)
    frame: int = 100
    asked: int = 0
    graphs: list[FormationGraph] = field(default_factory=list)

    @property
    def session(self) -> "Formation":
        return self

    def request(self, name: str, request: Request, **_: float) -> Reply:
        trouble = self.trouble.get(self.asked, "")
        self.asked += 1
        member = self.members[name]
        if trouble == "dies":
            member.alive = False
        if not member.alive:
            raise RequestFailedError(f"no process serves it for {name}")
        if trouble == "refuses" and not isinstance(request, WithdrawLeaders):
            return Reply(accepted=False, reason="no")
        if isinstance(request, PrepareLeaders):
            member.prepared = request
        elif isinstance(request, CommitLeaders):
            member.frame = request.frame
        else:
            member.prepared = member.frame = None
        if trouble == "answer lost":
            raise RequestFailedError(f"{name} did not answer")
        return Reply(accepted=True)

    def plan_of(self, name: str) -> "View":
        return View(plan_of(name, self.frame), self.members[name].following)

    def frame_period_s(self, name: str) -> float:
        return 0.02

    def wait_until(self, condition: Callable[[], bool], timeout_s: float, what: str) -> None:
        for _ in range(round(timeout_s / 0.02)):
            self.frame += 1
            for member in self.members.values():
                if (
                    member.alive
                    and member.prepared
                    and member.frame is not None
                    and self.frame >= member.frame
                ):
                    member.following = member.prepared.following
                    member.prepared = member.frame = None
            self.graphs.append(self.links)
            if condition():
                return
        raise TimeoutError(what)

    @property
    def links(self) -> FormationGraph:
        return {name: member.following for name, member in self.members.items()}


@dataclass
class View:
    newest: Plan
    following: tuple[LeaderLink, ...]

    @property
    def epoch(self) -> int:
        return self.newest.epoch

    @property
    def frame(self) -> int:
        return self.newest.frame

    @property
    def source(self) -> str:
        return self.newest.source


def formation(trouble: dict[int, str] | None = None) -> Formation:
    return Formation({name: Member(links) for name, links in TREE.items()}, trouble or {})


def change_in(fleet: Formation, first: str, second: str) -> None:
    change, where = swapped(STATUSES, first, second)
    regroup(fleet, change, where, {name: TREE[name] for name in change})  # type: ignore[arg-type]  # no bus


def test_everybody_takes_the_new_leaders_at_one_frame() -> None:
    fleet = formation()
    change_in(fleet, "h1", "h3")
    assert {name: tuple(item.leader for item in links) for name, links in fleet.links.items()} == {
        "h1": ("h3",),
        "h2": ("h3",),
        "h3": (),
        "h4": ("h1",),
    }
    assert sum(after != before for before, after in pairwise([TREE, *fleet.graphs])) == 1


@given(
    st.dictionaries(st.integers(0, 7), st.sampled_from(["refuses", "answer lost"]), min_size=1, max_size=3),
    st.sampled_from([("h1", "h2"), ("h1", "h3"), ("h3", "h4"), ("h2", "h4")]),
)
def test_who_refuses_or_is_not_heard_keeps_everybody_where_they_are(
    trouble: dict[int, str], pair: tuple[str, str]
) -> None:
    fleet = formation(trouble)
    try:
        change_in(fleet, *pair)
    except RefusedError as error:
        told = str(error)
    else:
        assert fleet.links != TREE
        return
    assert fleet.links == TREE
    if "did not confirm to keep" not in told:
        assert "nothing has changed" in told
        with pytest.raises(TimeoutError):
            fleet.wait_until(lambda: fleet.links != TREE, 2.0, "nothing changes")
    assert all(cycle(graph) == () for graph in fleet.graphs)


@given(st.integers(0, 7), st.sampled_from([("h1", "h2"), ("h1", "h3"), ("h3", "h4")]))
def test_who_dies_on_the_way_leaves_no_mixture_behind(number: int, pair: tuple[str, str]) -> None:
    fleet = formation({number: "dies"})
    try:
        change_in(fleet, *pair)
    except RefusedError:
        assert fleet.links == TREE
    assert all(cycle(graph) == () for graph in fleet.graphs)


def test_who_dies_before_the_frame_has_everybody_go_back() -> None:
    fleet = formation()
    change, where = swapped(STATUSES, "h1", "h3")
    before = {name: TREE[name] for name in change}
    plain = fleet.request

    def dying(name: str, request: Request, **options: float) -> Reply:
        reply = plain(name, request, **options)
        if isinstance(request, CommitLeaders) and fleet.asked == 2 * len(change):
            fleet.members["h4"].alive = False
        return reply

    fleet.request = dying  # type: ignore[method-assign]  # the vehicle dies after it has agreed
    with pytest.raises(RefusedError, match="h4 did not change leaders; all vehicles are as before"):
        regroup(fleet, change, where, before)  # type: ignore[arg-type]  # no bus
    assert fleet.links == TREE


def test_vehicles_that_do_not_fly_or_are_absent_change_no_roles() -> None:
    grounded = STATUSES | {"h2": status(TREE["h2"], phase="armed")}
    with pytest.raises(RefusedError, match="h2 does not fly, its phase is armed"):
        swapped(grounded, "h1", "h2")
    with pytest.raises(RefusedError, match="h9 is absent: its agent is silent"):
        swapped(STATUSES, "h1", "h9")


def test_the_head_of_a_formation_is_found_and_ambiguity_told() -> None:
    assert formation_leader(STATUSES, "h4") == "h1"
    with pytest.raises(RefusedError, match="h1 leads already"):
        formation_leader(STATUSES, "h1")
    with pytest.raises(RefusedError, match="h2 does not fly, its phase is ground"):
        formation_leader(STATUSES | {"h2": status(TREE["h2"], phase="ground")}, "h2")
    two = {"h1": status(()), "h2": status(()), "h3": status((link("h1", 1.0), link("h2", 1.0)))}
    with pytest.raises(RefusedError, match="several leaders at the head: h3 follows h1; h3 follows h2"):
        formation_leader(two, "h3")


def test_a_formation_whose_statuses_are_from_before_and_after_a_change_has_no_head() -> None:
    turning = {"h1": status((link("h2", 1.0),)), "h2": status((link("h1", -1.0),))}
    with pytest.raises(RefusedError, match="the leaders of h2 are changing; try again"):
        formation_leader(turning, "h2")


def test_vehicles_get_the_places_of_a_formation_in_order_or_by_the_shortest_ways() -> None:
    fleet = {
        "h1": hovering((0.0, 0.0, 1.0)),
        "h2": hovering((0.0, -1.0, 1.0)),
        "h3": hovering((0.0, 1.0, 1.0)),
    }
    landed = hovering((2.0, 2.0, 0.0), phase="disarmed")
    in_order = shaped({**fleet, "h4": landed}, "line", "h1", 1.0, ROOM, assign=False)
    assert {name: link.offset_m[1] for name, link in in_order.items()} == {"h2": 1.0, "h3": -1.0}
    nearest = shaped({**fleet, "h4": landed}, "line", "h1", 1.0, ROOM, assign=True)
    assert {name: link.offset_m[1] for name, link in nearest.items()} == {"h2": -1.0, "h3": 1.0}


def test_places_of_a_formation_are_those_beside_the_heading_of_the_leader() -> None:
    turned = hovering((0.0, 0.0, 1.0), set_point=SetPoint(position_m=(0.0, 0.0, 1.0), yaw_rad=math.pi))
    fleet = {"h1": turned, "h2": hovering((0.0, -1.0, 1.0)), "h3": hovering((0.0, 1.0, 1.0))}
    links = shaped(fleet, "line", "h1", 1.0, ROOM, assign=True)
    assert {name: link.offset_m[1] for name, link in links.items()} == {"h2": 1.0, "h3": -1.0}


def test_a_formation_with_a_place_outside_or_in_a_zone_is_refused() -> None:
    fleet = {"h1": hovering((1.5, 0.0, 1.0)), "h2": hovering((0.0, -1.0, 1.0))}
    zone = Zone(min_m=(1.4, 0.6, 0.0), max_m=(1.6, 0.8, 2.0))
    with pytest.raises(
        RefusedError, match=r"no place for h2: .* m is not 0.2 m clear of the keep-out zone lamp"
    ):
        shaped(fleet, "line", "h1", 0.6, replace(ROOM, zones={"lamp": zone}), assign=False)
    with pytest.raises(RefusedError, match=r"no place for h2: y: 2\.1 m is outside the flight volume"):
        shaped(fleet, "line", "h1", 2.1, ROOM, assign=False)
    assert shaped(fleet, "line", "h1", 0.6, ROOM, assign=False)


def test_a_formation_behind_a_vehicle_that_follows_or_stands_is_refused() -> None:
    with pytest.raises(RefusedError, match="h2 follows h1; let it lead first"):
        shaped(STATUSES, "line", "h2", 1.0, ROOM, assign=False)
    with pytest.raises(RefusedError, match="h1 does not fly"):
        shaped({"h1": hovering((0.0, 0.0, 0.0), phase="armed")}, "line", "h1", 1.0, ROOM, assign=False)


def test_a_leader_that_is_silent_or_refuses_keeps_no_other_from_being_suspended() -> None:
    fleet = Formation({name: Member(()) for name in ("h1", "h2", "h3")}, {0: "dies", 1: "refuses"})
    flying = {name: status(()) for name in fleet.members}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Formation, "statuses", lambda _: flying, raising=False)
        lines = pause(fleet, Suspend)  # type: ignore[arg-type]  # no bus
        assert lines == ["no process serves it for h1", "h2: no", "h3: "]
        fleet.trouble = dict.fromkeys(range(9), "refuses")
        with pytest.raises(RefusedError, match="no process serves it for h1; h2: no; h3: no"):
            pause(fleet, Suspend)  # type: ignore[arg-type]  # no bus
