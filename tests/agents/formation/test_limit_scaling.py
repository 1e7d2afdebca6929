"""Promises about the input range: a leader leaves its followers authority, also a promoted one."""

import numpy as np
import pytest
from support.flight import NotedController

from rcopterx.agents.formation.limit_scaling import (
    ARM_ACCELERATION_SHARE,
    ARM_SPEED_SHARE,
    LEADER_LIMIT_SCALE,
    NEXT_LIMIT_SCALE,
    YAW_RATE_SHARE,
    LimitScaling,
    arms_of,
    limit_scale_of,
    turn_limits_of,
)
from rcopterx.agents.formation.topology import exchanged, places
from rcopterx.bus.messages import LeaderLink
from rcopterx.control.interfaces import LimitScale
from rcopterx.vehicles.types import COAXIAL_LAG, QUADROTOR

TREE = {
    "h1": (),
    "h2": (LeaderLink(leader="h1", offset_m=(0.5, 0, 0)),),
    "h3": (LeaderLink(leader="h2", offset_m=(0.5, 0, 0)),),
    "h4": (LeaderLink(leader="h1", offset_m=(-0.5, 0, 0)),),
}


class Sharing(NotedController):
    def __init__(self) -> None:
        super().__init__(np.zeros((1, 4)))
        self.shares: list[float] = []

    def set_limit_scale(self, limit_scale: LimitScale) -> None:
        assert len(set(limit_scale.inputs)) == 1
        self.shares.append(limit_scale.inputs[0])


def test_every_level_of_followers_below_takes_a_share() -> None:
    for models in ({}, dict.fromkeys(TREE, COAXIAL_LAG), dict.fromkeys(TREE, QUADROTOR)):
        shares = {name: limit_scale_of(TREE, models, name) for name in TREE}
        for name, levels in (("h1", 2), ("h2", 1), ("h3", 0), ("h4", 0)):
            assert shares[name].rates == pytest.approx((1.0, 1.0, 1.0, YAW_RATE_SHARE**levels))
        inputs = {name: share.inputs for name, share in shares.items()}
        steps = {"h1": NEXT_LIMIT_SCALE * LEADER_LIMIT_SCALE, "h2": LEADER_LIMIT_SCALE, "h3": 1.0, "h4": 1.0}
        assert inputs == {name: pytest.approx(4 * (share,)) for name, share in steps.items()}


def test_a_leader_does_no_more_than_its_weakest_follower_can() -> None:
    """Whoever leads: what is left of accelerations and speeds, at any heading, is within the other's."""
    for leader, follower in ((QUADROTOR, COAXIAL_LAG), (COAXIAL_LAG, QUADROTOR)):
        models = {"h1": leader, "h2": follower, "h3": leader, "h4": leader}
        share = limit_scale_of(TREE, models, "h1")
        for axis, part in enumerate(share.inputs):
            strongest = min(1.0, part) * leader.b[axis] * (leader.u_max - leader.hover_input)[axis]
            weakest = follower.b * np.minimum(
                follower.u_max - follower.hover_input, follower.hover_input - follower.u_min
            )
            limit = weakest[:2].min() if axis < 2 else weakest[axis]
            assert strongest <= LEADER_LIMIT_SCALE * limit * (1.06 if axis < 2 else 1.0) + 1e-9
        speeds = np.array(share.rates) * leader.state_max[3:]
        assert (speeds <= np.maximum(follower.state_max[3:], 1e-9) + 1e-9).all()
    assert limit_scale_of(TREE, {"h1": QUADROTOR, "h2": COAXIAL_LAG}, "h1").inputs[0] == pytest.approx(
        NEXT_LIMIT_SCALE * LEADER_LIMIT_SCALE * 2.0 / QUADROTOR.b[0]
    )


def test_a_cycle_is_survived() -> None:
    circle = {"h1": (LeaderLink(leader="h2"),), "h2": (LeaderLink(leader="h1"),)}
    assert limit_scale_of(circle, {}, "h1").inputs == pytest.approx(
        4 * (NEXT_LIMIT_SCALE * LEADER_LIMIT_SCALE,)
    )


def test_the_share_changes_with_the_leader_and_is_told_once() -> None:
    authority, controller = LimitScaling("h4", {}), Sharing()
    authority.update(controller, {}, TREE)
    authority.update(controller, {}, TREE)
    promoted = TREE | exchanged(TREE, places(TREE, {"h1": np.zeros(4)}), "h1", "h4")
    authority.update(controller, {}, promoted)
    assert controller.shares == pytest.approx([1.0, NEXT_LIMIT_SCALE * LEADER_LIMIT_SCALE])


def test_another_controller_is_told_too() -> None:
    authority, first, second = LimitScaling("h2", {}), Sharing(), Sharing()
    authority.update(first, {}, TREE)
    authority.update(second, {}, TREE)
    assert first.shares == second.shares == pytest.approx([LEADER_LIMIT_SCALE])


def test_a_fixed_range_and_an_unknown_formation_change_nothing() -> None:
    controller = Sharing()
    LimitScaling("h1", {}).update(controller, {"input_range": 0.5}, TREE)
    LimitScaling("h1", {}).update(controller, {}, {"h1": ()})
    LimitScaling("h1", {}).update(NotedController(np.zeros((1, 4))), {}, TREE)
    assert controller.shares == []


def test_arms_are_the_circles_on_which_a_leader_carries_others_round() -> None:
    abreast = LeaderLink(leader="h1", offset_m=(0.0, 0.6, 0.3), frame="heading", yaw_offset_rad=np.pi / 2)
    links = {
        "h1": (),
        "h2": (abreast,),
        "h3": (LeaderLink(leader="h2", offset_m=(0.5, 0.0, 0.0)),),
        "h4": (LeaderLink(leader="h2", offset_m=(0.8, 0.0, 0.0), frame="heading"),),
        "h5": (LeaderLink(leader="h1", offset_m=(0.4, 0.0, 0.0)),),
        "h6": (abreast, LeaderLink(leader="h5", offset_m=(0.0, 0.6, 0.0))),
        "h7": (LeaderLink(leader="h8", offset_m=(0.0, 0.6, 0.0), frame="heading"),),
        "h8": (),
    }
    arms = {"h2": 0.6, "h3": 0.6, "h4": 1.4, "h6": 0.3}
    assert arms_of(links, "h1") == pytest.approx(arms)
    assert arms_of(links, "h2") == pytest.approx({"h4": 0.8})
    assert arms_of(links, "h8") == pytest.approx({"h7": 0.6})
    assert arms_of(links, "h5") == {}


def test_the_longest_arm_and_the_weakest_follower_limit_a_turn() -> None:
    links = {
        f"h{number}": (LeaderLink(leader="h1", offset_m=(x, 0.0, 0.0), frame="heading"),)
        for number, x in ((2, 0.3), (3, 0.6))
    }
    models = dict.fromkeys(("h1", "h2", "h3"), COAXIAL_LAG)
    limits = turn_limits_of(links, models, "h1")
    assert limits is not None
    assert limits.rate_rad_s == pytest.approx(ARM_SPEED_SHARE * 1.0 / 0.6)
    assert limits.acceleration_rad_s2 == pytest.approx(ARM_ACCELERATION_SHARE * 2.0 / 0.6)
    short = {"h1": (), "h2": (LeaderLink(leader="h1", offset_m=(0.1, 0.0, 0.0), frame="heading"),)}
    turning = turn_limits_of(short, models, "h1")
    assert turning is not None
    assert turning.rate_rad_s == pytest.approx(YAW_RATE_SHARE * COAXIAL_LAG.state_max[6])
    stronger = turn_limits_of(links, models | {"h3": QUADROTOR}, "h1")
    assert stronger is not None
    assert stronger.acceleration_rad_s2 > limits.acceleration_rad_s2
    assert turn_limits_of(links, models, "h2") is None
    assert turn_limits_of(links, {}, "h1") is None
