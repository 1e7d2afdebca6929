"""An agent that is started again in flight goes on exactly: with its turns, and along its trajectory."""

import math

import pytest
from integration_support import Flying, Truth, counter, wait_for_successor

from rcopterx.control.references.path_shapes import circle
from rcopterx.ground_station.scripting.state import VehicleState

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

TURNED_RAD = 2 * math.pi
"""A turn, which a motion capture cannot distinguish from none."""


def heading_rad(state: VehicleState) -> float:
    assert state.agent is not None
    assert state.agent.yaw_rad is not None
    return state.agent.yaw_rad


def path_left_s(state: VehicleState) -> float:
    return 0.0 if state.agent is None else state.agent.path_left_s


def test_a_leader_that_has_turned_does_not_turn_back_when_its_agent_is_killed(
    flying: Flying, truth: Truth
) -> None:
    fleet = flying.fleet
    fleet["h1"].go_to((0.0, 0.0, 0.8), turns=1)
    fleet.wait_for_arrival(["h1"], timeout_s=40)
    flying.wait_for_spare("agent-h1")
    wait_for_successor(flying, "h1", flying.kill("agent-h1"))
    after = fleet.state_of("h1").agent
    assert after is not None
    assert after.set_point.yaw_rad == pytest.approx(TURNED_RAD, abs=0.5)
    assert heading_rad(fleet.state_of("h1")) == pytest.approx(TURNED_RAD, abs=1.0)
    fleet.wait_for_formation()
    assert heading_rad(fleet.state_of("h1")) == pytest.approx(TURNED_RAD, abs=0.5)
    fleet["h1"].go_to((0.0, 0.0, 0.8), turns=-1)
    fleet.wait_for_arrival(["h1"], timeout_s=40)
    truth.assert_none_touched_down()


def test_a_trajectory_is_flown_to_its_end_when_the_agent_is_killed(flying: Flying, truth: Truth) -> None:
    # A machine that is too busy to start the successor while plans last has its vehicle held, which ends a
    # trajectory; that shows nothing here, so it is flown again.
    assert any(flown_to_its_end(flying) for _ in range(3)), "held every time"
    flying.fleet.wait_for_formation()
    truth.assert_none_touched_down()


def flown_to_its_end(flying: Flying) -> bool:
    """Kill the leader's agent while it flies a trajectory; False if the vehicle was held meanwhile."""
    fleet = flying.fleet
    flying.wait_for_spare("agent-h1")
    fleet["h1"].fly(circle((0.0, 0.0, 0.9), 0.2, 4.5), wait=False)
    fleet.wait_until(lambda: path_left_s(fleet.state_of("h1")) > 0.0, 30, "it does not begin")
    held = counter(flying, "h1", "entered HOLD")
    begun_left_s, begun_s = path_left_s(fleet.state_of("h1")), fleet.session.clock()
    fleet.wait_until(lambda: path_left_s(fleet.state_of("h1")) < begun_left_s - 2.5, 30, "it does not go on")
    wait_for_successor(flying, "h1", flying.kill("agent-h1"))
    left_s = begun_left_s - (fleet.session.clock() - begun_s)
    after_s = path_left_s(fleet.state_of("h1"))
    fleet.wait_until(lambda: path_left_s(fleet.state_of("h1")) == 0.0, 30, "it does not end")
    if counter(flying, "h1", "entered HOLD") > held:
        return False
    # Begun anew, it would take two and a half seconds longer.
    assert after_s == pytest.approx(left_s, abs=1.5)
    return True
