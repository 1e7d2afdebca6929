"""Promises of the laboratory as a whole."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.conditions import IDEAL, LABORATORY
from support.vehicle_types import COAXIAL_LAG, TYPES

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose


def laboratory(names: tuple[str, ...], seed: int = 0, conditions: Conditions = LABORATORY) -> Laboratory:
    models = dict.fromkeys(names, COAXIAL_LAG)
    start = {name: BodyPose((0.5 * i, 0.0, 1.0)) for i, name in enumerate(sorted(names))}
    return Laboratory(models, start, conditions, seed)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000))
def test_flight_of_one_vehicle_does_not_depend_on_the_others(seed: int) -> None:
    few, many = laboratory(("h1", "h2"), seed), laboratory(("h2", "h9", "h1", "h5"), seed)
    for lab in (few, many):
        lab.plants["h1"].set_input((0.1, 0.0, 0.55, 0.0))
        lab.advance(0.5)
    assert few.plants["h1"].pose == many.plants["h1"].pose
    assert few.measured_pose("h1") == many.measured_pose("h1")


def test_the_same_inputs_lead_to_exactly_the_same_flight() -> None:
    def fly() -> list[BodyPose]:
        lab = laboratory(("h1", "h2"), 7)
        poses = []
        for _ in range(20):
            lab.plants["h2"].set_input((0.0, 0.1, 0.56, 0.1))
            lab.advance(0.02)
            poses += [lab.measured_pose(name) for name in lab.plants]
        return poses

    assert fly() == fly()


def test_measured_poses_have_the_stated_noise() -> None:
    lab = laboratory(("h1",))
    true = lab.plants["h1"].pose
    measured = [lab.measured_pose("h1") for _ in range(4000)]
    position = np.array([pose.position_m for pose in measured]) - true.position_m
    yaw = np.array([pose.yaw_rad for pose in measured]) - true.yaw_rad
    assert np.allclose(position.std(axis=0), 0.0003, rtol=0.06)
    assert np.isclose(yaw.std(), 0.002, rtol=0.06)
    assert np.all(np.abs(position.mean(axis=0)) < 3e-5)


def test_measured_yaw_is_wrapped_and_ideal_measurement_is_exact() -> None:
    lab = Laboratory({"h1": COAXIAL_LAG}, {"h1": BodyPose((0.0, 0.0, 1.0), 3 * math.pi - 0.1)}, IDEAL)
    assert lab.plants["h1"].pose.yaw_rad == pytest.approx(3 * math.pi - 0.1)
    assert lab.measured_pose("h1").yaw_rad == pytest.approx(math.pi - 0.1)
    assert lab.measured_pose("h1").position_m == lab.plants["h1"].pose.position_m


def test_turbulence_moves_a_hovering_vehicle_as_strongly_as_stated() -> None:
    calm = replace(IDEAL, turbulence_rms=LABORATORY.turbulence_rms)
    lab = Laboratory({"h1": COAXIAL_LAG}, {"h1": BodyPose((0.0, 0.0, 100.0))}, calm, 0)
    lab.plants["h1"].set_input(COAXIAL_LAG.hover_input)
    speeds = []
    for _ in range(3000):
        lab.advance(0.1)
        speeds.append(lab.plants["h1"].motion[4:6])
    # White-noise theory of a damped mass: variance sigma^2 tau / (k (1 + k tau)) per axis.
    k, tau = 0.45, 0.5
    expected = 0.15 * math.sqrt(tau / (k * (1 + k * tau)))
    assert np.sqrt(np.mean(np.square(speeds))) == pytest.approx(expected, rel=0.2)


def test_both_vehicle_types_fly_together() -> None:
    lab = Laboratory(dict(TYPES), {name: BodyPose((0.0, 0.0, 1.0)) for name in TYPES}, IDEAL)
    for name, model in TYPES.items():
        lab.plants[name].set_input(model.hover_input)
    lab.advance(5.0)
    assert all(lab.plants[name].pose.position_m == pytest.approx((0.0, 0.0, 1.0)) for name in TYPES)


def test_unusable_requests_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="h2: each vehicle needs a model and a start pose"):
        Laboratory({"h1": COAXIAL_LAG, "h2": COAXIAL_LAG}, {"h1": BodyPose((0.0, 0.0, 1.0))}, IDEAL)
    with pytest.raises(ValueError, match="seed -1 is negative"):
        Laboratory({}, {}, IDEAL, -1)


def test_the_origin_of_a_tilted_subject_is_beside_its_centre_of_gravity() -> None:
    pose = BodyPose((1.0, 2.0, 1.0), yaw_rad=math.pi / 2, pitch_rad=0.1)
    assert pose.above(-0.04) == pytest.approx(
        (1.0, 2.0 - 0.04 * math.sin(0.1), 1.0 + 0.04 * (1.0 - math.cos(0.1)))
    )
    assert BodyPose((1.0, 2.0, 0.0), yaw_rad=2.0).above(-0.04) == (1.0, 2.0, 0.0)
