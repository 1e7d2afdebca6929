"""An agent that is started again in flight goes on exactly: with its turns, and along its trajectory."""

import math
from collections.abc import Callable

import pytest
from integration_support import Flying, Truth

from agents.references.path_shapes import circle
from ground_station.state import VehicleState

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]

TURNED_RAD = 3 * math.pi
"""A turn and a half, as a motion capture cannot tell from half a turn."""


def heading_rad(state: VehicleState) -> float:
    assert state.agent is not None
    assert state.agent.yaw_rad is not None
    return state.agent.yaw_rad


def path_left_s(state: VehicleState) -> float:
    return 0.0 if state.agent is None else state.agent.path_left_s


def wait_for_successor(flying: Flying, process: int) -> None:
    """Wait until another process flies h1."""

    def flown() -> bool:
        agent = flying.fleet.state_of("h1").agent
        return agent is not None and agent.phase == "flying" and agent.diagnostics.process != process

    flying.fleet.wait_until(flown, 15, "h1 is not flown again")


def test_a_leader_that_has_turned_does_not_turn_back_when_its_agent_is_killed(launch: Launch) -> None:
    flying = launch(control='controller = "cascade"\nhorizon = 30')
    fleet, truth = flying.fleet, Truth(flying)
    fleet.take_off(height_m=0.9)
    fleet.wait_for_formation()
    truth.start_watch()
    fleet["h1"].go_to((0.0, 0.0, 1.0), TURNED_RAD)
    fleet.wait_for_arrival(["h1"], timeout_s=40)
    fleet.wait_until(
        lambda: abs(heading_rad(fleet.state_of("h1")) - TURNED_RAD) < 0.1, 30, "h1 has not turned"
    )
    flying.wait_for_spare("agent-h1")
    before = fleet.state_of("h1").agent
    assert before is not None
    flying.kill("agent-h1")

    wait_for_successor(flying, before.diagnostics.process)
    after = fleet.state_of("h1").agent
    assert after is not None
    assert after.set_point.yaw_rad == pytest.approx(TURNED_RAD)
    assert heading_rad(fleet.state_of("h1")) == pytest.approx(TURNED_RAD, abs=0.2)
    fleet.wait_for_formation()
    assert heading_rad(fleet.state_of("h1")) == pytest.approx(TURNED_RAD, abs=0.2)
    truth.assert_nobody_touched_down()


def test_a_trajectory_is_flown_to_its_end_when_the_agent_is_killed(launch: Launch) -> None:
    flying = launch(control='controller = "cascade"\nhorizon = 30')
    fleet, truth = flying.fleet, Truth(flying)
    fleet.take_off(height_m=0.9)
    fleet.wait_for_formation()
    truth.start_watch()
    flying.wait_for_spare("agent-h1")
    fleet["h1"].fly(circle((0.0, 0.0, 1.0), 0.3, 8.0), wait=False)
    fleet.wait_until(lambda: path_left_s(fleet.state_of("h1")) > 0.0, 5, "it does not begin")
    begun_left_s, begun_s = path_left_s(fleet.state_of("h1")), fleet.session.clock()
    before = fleet.state_of("h1").agent
    assert before is not None
    fleet.wait_until(lambda: path_left_s(fleet.state_of("h1")) < begun_left_s - 2.0, 10, "it does not go on")
    flying.kill("agent-h1")
    wait_for_successor(flying, before.diagnostics.process)
    left_s = begun_left_s - (fleet.session.clock() - begun_s)
    assert path_left_s(fleet.state_of("h1")) == pytest.approx(left_s, abs=0.6)
    fleet.wait_until(lambda: path_left_s(fleet.state_of("h1")) == 0.0, 20, "it does not end")
    fleet.wait_for_formation()
    truth.assert_nobody_touched_down()
