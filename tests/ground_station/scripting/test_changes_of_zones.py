"""Promises of changes of keep-out zones by programs, and of ways round zones."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from support.statuses import hovering

from rcopterx.bus.messages import AgentStatus, LeaderLink, Zone, ZoneSet
from rcopterx.bus.requests import Reply, SetZones
from rcopterx.bus.session import RequestFailedError
from rcopterx.fleet.errors import FleetError
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.formation.placement import entered
from rcopterx.ground_station.scripting.room import way_round
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.ground_station.scripting.zones import change_zone

TRIO = load_fleet(fleet_path("trio"))
PILLAR = Zone(min_m=(0.4, -0.2, 0.0), max_m=(0.6, 0.2, 2.0))


class Agents:
    """A running fleet as far as zones go: what agents answer, and what they were sent."""

    file = TRIO

    def __init__(self, zones: dict[str, Zone], **statuses: AgentStatus) -> None:
        self.zones = ZoneSet(revision=4, zones=zones)
        self.known = statuses or {name: hovering((0.0, 0.0, 1.0)) for name in TRIO.vehicles}
        self.joined = True  # False until the first statuses have arrived
        self.answers: dict[str, Reply | None] = {}
        self.sent: dict[str, ZoneSet] = {}

    @property
    def session(self) -> Any:
        return SimpleNamespace(request=self._request)

    def _request(self, vehicle: str, request: SetZones) -> Reply:
        self.sent[vehicle] = request.zones
        reply = self.answers.get(vehicle, Reply(accepted=True))
        if reply is None:
            raise RequestFailedError("no answer")
        return reply

    def statuses(self) -> dict[str, AgentStatus]:
        return self.known if self.joined else {}

    def wait_for_status(self) -> None:
        self.joined = True


def test_every_agent_gets_the_whole_set_with_the_next_revision() -> None:
    fleet = Agents({"pillar": PILLAR})
    change_zone(fleet, "table", PILLAR)  # type: ignore[arg-type]  # no bus
    wanted = ZoneSet(revision=5, zones={"pillar": PILLAR, "table": PILLAR})
    assert fleet.sent == dict.fromkeys(TRIO.vehicles, wanted)
    change_zone(fleet, "pillar", None)  # type: ignore[arg-type]
    assert fleet.sent == dict.fromkeys(TRIO.vehicles, ZoneSet(revision=5, zones={}))


def test_a_silent_agent_does_not_hold_up_the_others_and_a_refusal_is_reported() -> None:
    fleet = Agents({})
    fleet.answers["h1"] = None
    change_zone(fleet, "table", PILLAR)  # type: ignore[arg-type]
    assert fleet.sent.keys() == TRIO.vehicles.keys()
    fleet.answers = dict.fromkeys(TRIO.vehicles)
    with pytest.raises(RefusedError, match="no agent has answered"):
        change_zone(fleet, "table", PILLAR)  # type: ignore[arg-type]
    fleet.answers = {"h2": Reply(accepted=False, reason="its zones have changed meanwhile, try again")}
    with pytest.raises(RefusedError, match="h2: its zones have changed"):
        change_zone(fleet, "table", PILLAR)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "zone", "reason"),
    [
        ("table", Zone(min_m=(0.0, 0.0, 0.0), max_m=(1.0, 0.0, 1.0)), r"zones.table.max_m\[1\]"),
        ("table", Zone(min_m=(0.0, 0.0, 0.0), max_m=(1.0, 2.0, 1.0), shape="cylinder"), "square"),
        ("My table", PILLAR, "zones"),
        ("table", Zone(min_m=(0.0, 0.0, 0.0), max_m=(1.0, 1.0, 1.0), margin_m=-1.0), "margin_m"),
    ],
)
def test_a_wrong_zone_is_refused_before_anything_is_sent(name: str, zone: Zone, reason: str) -> None:
    fleet = Agents({})
    with pytest.raises(FleetError, match=reason):
        change_zone(fleet, name, zone)  # type: ignore[arg-type]
    assert not fleet.sent


def test_only_a_zone_that_exists_can_be_removed() -> None:
    with pytest.raises(RefusedError, match="no keep-out zone 'table', there are pillar"):
        change_zone(Agents({"pillar": PILLAR}), "table", None)  # type: ignore[arg-type]


def way_of(fleet: Agents, x: float) -> np.ndarray | None:
    way = way_round(fleet, "h1", (x, 0.0, 1.0, 0.3))  # type: ignore[arg-type]
    if way is None:
        return None
    assert way.knots[-1, 1:5] == pytest.approx((x, 0.0, 1.0, 0.3))
    return way.sample(np.arange(0.0, way.duration_s + 0.05, 0.05))[:, :3]


def test_a_way_round_a_pillar_keeps_its_margin_also_with_a_follower_beside_it() -> None:
    alone = way_of(Agents({"pillar": PILLAR}, h1=hovering((0.0, 0.0, 1.0))), 1.0)
    assert alone is not None
    assert entered(PILLAR, alone) is None
    follower = hovering((0.0, 0.5, 1.0), LeaderLink(leader="h1", offset_m=(0.0, 0.5, 0.0)))
    both = way_of(Agents({"pillar": PILLAR}, h1=hovering((0.0, 0.0, 1.0)), h2=follower), 1.0)
    assert both is not None
    assert entered(PILLAR, both) is None
    assert entered(PILLAR, both + np.array((0.0, 0.5, 0.0))) is None
    assert not np.array_equal(alone, both)


def test_a_program_that_has_just_joined_waits_for_statuses_before_it_plans_a_way() -> None:
    fleet = Agents({"pillar": PILLAR}, h1=hovering((0.0, 0.0, 1.0)))
    fleet.joined = False
    assert way_of(fleet, 1.0) is not None


@pytest.mark.parametrize("beside_m", [0.0, 0.01, 0.1])
def test_a_way_that_begins_at_or_in_the_margin_does_not_lead_through_the_pillar(beside_m: float) -> None:
    x = PILLAR.min_m[0] - PILLAR.margin_m - 0.01 + beside_m
    way = way_of(Agents({"pillar": PILLAR}, h1=hovering((x, 0.0, 1.0))), 1.0)
    assert way is not None
    assert entered(PILLAR, way) is None
    assert entered(replace(PILLAR, margin_m=0.0), way) is None


def test_there_is_no_way_round_without_a_zone_in_the_way_or_to_a_place_in_one() -> None:
    assert way_of(Agents({}), 1.0) is None
    assert way_of(Agents({"pillar": PILLAR}), -0.5) is None
    assert way_of(Agents({"pillar": PILLAR}), 0.5) is None
    wall = Zone(min_m=(0.4, -9.0, 0.0), max_m=(0.6, 9.0, 9.0))
    assert way_of(Agents({"wall": wall}), 1.0) is None
