"""Vehicles whose agents are killed or hang fly on, or land gently where they were."""

import math
from contextlib import ExitStack

import pytest
from integration_support import (
    NAMES,
    Flying,
    Truth,
    all_states,
    counter,
    flown_by,
    fly_to,
    in_formation,
    on_floor,
    transmitter_state,
    wait_for_successor,
)

from rcopterx import RefusedError, Zone, through
from rcopterx_studies.faults.agent_process import kill_agent

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]


def offset_m(flying: Flying, name: str) -> tuple[float, float, float] | None:
    """Offset to its leader at which a vehicle flies now."""
    status = flying.fleet.state_of(name).agent
    return status.following[0].offset_m if status is not None and status.following else None


def kill_and_wait(flying: Flying, name: str) -> None:
    """Kill an agent; a spare process flies its vehicle soon."""
    flying.wait_for_spare(f"agent-{name}")
    wait_for_successor(flying, name, flying.kill(f"agent-{name}"))


@pytest.mark.lockstep
def test_leader_and_fleet_fly_on_when_its_agent_is_killed(flying: Flying, truth: Truth) -> None:
    restarts = flying.restarts("agent-h1")
    kill_and_wait(flying, "h1")
    flying.fleet.wait_until(lambda: in_formation(flying, truth), 30, "no formation after the restart")
    fly_to(flying, truth, (0.2, 0.0, 0.9))
    truth.assert_none_touched_down()
    assert flying.restarts("agent-h1") == restarts + 1


@pytest.mark.lockstep
def test_a_way_that_a_zone_bars_is_suspended_also_when_the_agent_is_killed_then(flying: Flying) -> None:
    fleet = flying.fleet
    fleet["h1"].fly(through([(0.0, 0.0, 0.0, 0.8, 0.0), (10.0, 1.1, 0.0, 0.8, 0.0)]))
    fleet.wait(3.0)
    fleet.set_zone("visitor", Zone(min_m=(0.9, -0.3, 0.0), max_m=(1.1, 0.3, 1.9), margin_m=0.1))
    fleet.wait(4.0)
    state = fleet.state_of("h1")
    assert state.remarks.startswith("suspended: (0.8")
    assert state.place_m is not None
    assert state.place_m[0] < 0.8
    kill_and_wait(flying, "h1")
    fleet.wait(1.0)
    status = fleet.state_of("h1").agent
    assert status is not None
    assert status.zones is not None
    assert status.zones.zones.keys() == {"visitor"}
    with pytest.raises(RefusedError, match="keep-out zone visitor"):
        fleet.resume()
    fleet.set_zone("visitor", None)
    assert "goes on" in "".join(fleet.resume())
    fleet.wait_for_arrival(["h1"])
    assert fleet.state_of("h1").place_m == pytest.approx((1.1, 0.0, 0.8), abs=0.15)


@pytest.mark.lockstep
def test_follower_keeps_its_task_when_its_agent_is_killed(flying: Flying, truth: Truth) -> None:
    fleet, file_offset_m = flying.fleet, (-0.4, 0.5, 0.0)
    asked_m = pytest.approx((-0.5, 0.4, 0.1), abs=1e-6)
    fleet["h2"].follow("h1", (-0.5, 0.4, 0.1))
    fleet.wait_until(lambda: offset_m(flying, "h2") == asked_m, 30, "offset not reached", ["h2"])
    kill_and_wait(flying, "h2")
    fleet.wait_until(lambda: offset_m(flying, "h2") == asked_m, 30, "task forgotten", ["h2"])
    fleet.wait_for_formation(["h2"])
    truth.assert_none_touched_down()
    fleet["h2"].follow("h1", file_offset_m)


def test_an_agent_that_a_user_kills_by_its_vehicle_has_a_successor_that_can_be_killed_so_too(
    flying: Flying, truth: Truth
) -> None:
    flying.wait_for_spare("agent-h2")
    pid = flying.pid("agent-h2")
    assert kill_agent(flying.fleet.file, "h2") == pid
    wait_for_successor(flying, "h2", pid)
    flying.wait_for_spare("agent-h2")
    successor = flying.pid("agent-h2")
    flying.fleet.wait_for_formation()
    assert kill_agent(flying.fleet.file, "h2") == successor
    wait_for_successor(flying, "h2", successor)
    flying.fleet.wait_for_formation()
    truth.assert_none_touched_down()


@pytest.mark.lockstep
def test_frozen_agent_is_bridged_by_its_plan_then_landed_until_it_flies_again(
    flying: Flying, truth: Truth
) -> None:
    before = {what: counter(flying, "h2", what) for what in ("planned inputs played", "entered LAND")}
    with flying.stopped("agent-h2"):
        flying.fleet.wait_until(
            lambda: all(counter(flying, "h2", what) > count for what, count in before.items()),
            30,
            "not bridged and landed",
            ["h2"],
        )
    flying.fleet.wait_until(lambda: flown_by(flying, "h2") is not None, 30, "not flown again", ["h2"])
    flying.fleet.wait_until(lambda: in_formation(flying, truth), 30, "no formation")
    assert truth.height_m("h1") > 0.5
    assert transmitter_state(flying, "h2") == "armed"


@pytest.mark.lockstep
def test_vehicles_whose_agents_hang_for_two_seconds_are_flown_again(flying: Flying, truth: Truth) -> None:
    # High, because they descend until they are flown again.
    fly_to(flying, truth, (0.0, 0.0, 1.4))
    flying.fleet.wait_until(truth.rested, 30, "not hovering", NAMES)
    with ExitStack() as stack:
        for name in NAMES:
            stack.enter_context(flying.stopped(f"agent-{name}"))
        flying.fleet.wait(2.0)
    flying.fleet.wait_until(
        lambda: all(flown_by(flying, name) is not None for name in NAMES) and truth.rested(),
        30,
        "not flown again",
        NAMES,
    )
    truth.assert_none_touched_down()


@pytest.mark.lockstep
def test_vehicles_whose_agents_never_come_back_land_where_they_were(flying: Flying, truth: Truth) -> None:
    places = {name: vehicle.position_m for name in NAMES if (vehicle := truth(name)) is not None}
    for name in NAMES:
        flying.want(f"agent-{name}", False)
    flying.fleet.wait_until(
        lambda: all(on_floor(truth, name) for name in NAMES) and all_states(flying, "cut"), 30, "not landed"
    )
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        assert vehicle.touchdown_speed_m_s < 0.6
        assert math.dist(vehicle.position_m[:2], places[name][:2]) < 0.3
