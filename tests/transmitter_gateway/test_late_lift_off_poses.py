"""Poses of a lift-off that reach a busy gateway together are judged by the times of their frames."""

import pytest

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import Input, PoseInput
from rcopterx.vehicles.lift_off import LiftOffLimits
from rcopterx.vehicles.state import GRAVITY_M_S2

U_HOVER, FRAME_S = 0.55, 0.02
SLEW: Input = (20.0, 20.0, 4.0, 8.0)
JUMPED = "its pose jumped"
SPEED_M_S = 0.85
CLIMB_M_S = 0.4


class Hop:
    """A vehicle that stands, and hops when its rotor has turned; poses arrive in groups."""

    def __init__(self, together: int) -> None:
        self.arbiter = Arbiter(
            "h1", ArbiterLimits(lift_off=LiftOffLimits(hover_thrust=U_HOVER)), U_HOVER, SLEW
        )
        self.frame, self.together = 0, together
        for number in range(50):
            self.pose(1e-4 * (number % 3))
        for _ in range(6):
            self.arbiter.lift_off.thrust(1.5 * U_HOVER, FRAME_S, stands=False)

    def pose(self, height_m: float) -> None:
        self.frame += 1
        arrives_s = FRAME_S * (self.together * -(-self.frame // self.together))
        pose = PoseInput("h1", 1, self.frame, (0.0, 0.0, height_m), FRAME_S, 0.0)
        self.arbiter.pose(pose, arrives_s)

    def hop(self) -> None:
        for number in range(1, round(2.0 * SPEED_M_S / GRAVITY_M_S2 / FRAME_S)):
            after_s = number * FRAME_S
            self.pose(SPEED_M_S * after_s - 0.5 * GRAVITY_M_S2 * after_s**2)
            self.arbiter.lift_off.thrust(0.0, FRAME_S, stands=False)


@pytest.mark.parametrize("together", [1, 2, 3])
def test_a_hop_whose_poses_arrive_together_is_no_jump(together: int) -> None:
    hop = Hop(together)
    hop.hop()
    assert hop.arbiter.lift_off.problem != JUMPED


@pytest.mark.parametrize("together", [1, 5, 20])
def test_a_climb_whose_poses_wait_for_a_stopped_gateway_is_no_jump(together: int) -> None:
    hop = Hop(together)
    for number in range(1, 60):
        if number == 40:  # the gateway is up to date again
            hop.together = 1
        hop.pose(CLIMB_M_S * number * FRAME_S)
    assert hop.arbiter.lift_off.problem is None


@pytest.mark.parametrize("together", [1, 2, 3])
def test_a_pose_that_jumps_is_found_also_when_it_arrives_with_others(together: int) -> None:
    hop = Hop(together)
    hop.pose(0.005)
    hop.pose(0.25)
    assert hop.arbiter.lift_off.problem == JUMPED
