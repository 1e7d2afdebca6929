"""Promises of the limits of leaders' ways: what all vehicles below can surely follow."""

from dataclasses import replace

import numpy as np
import pytest
from support.vehicle_types import COAXIAL_LAG, QUADROTOR

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.profile_limits import (
    ACCELERATION_SHARE,
    ARM_ACCELERATION_SHARE,
    ARM_SPEED_SHARE,
    SPEED_SHARE,
    arms_of,
    profile_limits_of,
)

LINKS = {"h1": ()} | {f"h{k}": (LeaderLink(leader=f"h{k - 1}", offset_m=(0.5, 0, 0)),) for k in range(2, 21)}
ALIKE = dict.fromkeys(LINKS, COAXIAL_LAG)


def test_limits_do_not_depend_on_the_depth_of_a_chain() -> None:
    found = {profile_limits_of(LINKS, ALIKE, f"h{k}") for k in range(1, 20)}
    assert len(found) == 1
    assert None not in found


def test_a_vehicle_without_followers_is_not_limited() -> None:
    assert profile_limits_of(LINKS, ALIKE, "h20") is None
    assert profile_limits_of(LINKS, {}, "h1") is None


def test_the_weakest_vehicle_below_limits_its_leaders_at_any_heading() -> None:
    strong = dict.fromkeys(LINKS, QUADROTOR)
    limits = profile_limits_of(LINKS, strong | {"h20": COAXIAL_LAG}, "h1")
    assert limits is not None
    assert limits.rate[0] <= SPEED_SHARE * min(COAXIAL_LAG.state_max[3:5]) + 1e-9
    reach = min(COAXIAL_LAG.b[:2]) * ACCELERATION_SHARE / COAXIAL_LAG.uncertainty.gain_factor[0]
    assert limits.acceleration[0] <= reach + 1e-9
    own = profile_limits_of(LINKS, strong | {"h1": COAXIAL_LAG}, "h1")
    assert own is not None
    assert own.acceleration[0] > limits.acceleration[0]


def test_followers_that_are_known_badly_are_trusted_with_less() -> None:
    vague = replace(COAXIAL_LAG, uncertainty=replace(COAXIAL_LAG.uncertainty, gain_factor=(2.0, 2.0, 2.0)))
    limits = [profile_limits_of(LINKS, ALIKE | {"h5": model}, "h1") for model in (COAXIAL_LAG, vague)]
    assert limits[0] is not None
    assert limits[1] is not None
    assert limits[1].acceleration[0] < limits[0].acceleration[0]


def test_a_cycle_is_survived() -> None:
    circle = {"h1": (LeaderLink(leader="h2"),), "h2": (LeaderLink(leader="h1"),)}
    assert profile_limits_of(circle, dict.fromkeys(circle, COAXIAL_LAG), "h1") is not None


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
    limits = profile_limits_of(links, models, "h1")
    assert limits is not None
    assert limits.rate[2] == pytest.approx(ARM_SPEED_SHARE * 1.0 / 0.6)
    assert limits.acceleration[2] == pytest.approx(ARM_ACCELERATION_SHARE * 2.0 / 0.6)
    short = {"h1": (), "h2": (LeaderLink(leader="h1", offset_m=(0.1, 0.0, 0.0), frame="heading"),)}
    turning = profile_limits_of(short, models, "h1")
    assert turning is not None
    assert turning.rate[2] == pytest.approx(SPEED_SHARE * COAXIAL_LAG.state_max[6])
    stronger = profile_limits_of(links, models | {"h3": QUADROTOR}, "h1")
    assert stronger is not None
    assert stronger.acceleration[2] > limits.acceleration[2]
    assert profile_limits_of(links, models, "h2") is None
    assert profile_limits_of(links, {}, "h1") is None
