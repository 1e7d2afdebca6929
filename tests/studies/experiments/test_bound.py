"""Bounds of the error in hover: their regulator reaches them in the simulator, and nothing is better."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.conditions import HELICOPTER, HELICOPTERS
from support.records import replace as changed
from support.vehicle_types import COAXIAL
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.helicopter import Helicopter
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import GRAVITY_M_S2, U_THRUST, Array
from rcopterx_studies.experiments.bound import (
    STICKS,
    TILT,
    best,
    continuous,
    following,
    formation_mm,
    hover_mm,
    hovering,
)
from rcopterx_studies.experiments.record import rms
from rcopterx_studies.experiments.rig import PERIOD_S, Rig
from rcopterx_studies.experiments.schemes import CASCADE

NOMINAL = HelicopterParameters.nominal()
GUSTS = replace(HELICOPTER, turbulence_rms=(0.15, 0.15, 0.0, 0.0), battery_sag=0.0, radio_period_s=0.0)


def flown_by_regulator(feedback: Array, conditions: Conditions, duration_s: float) -> tuple[Array, Array]:
    """Places, shape (K, 2), and sticks of the nominal helicopter with a Kalman filter and this feedback."""
    system = hovering(NOMINAL, conditions)
    c, noise = (
        np.zeros((4, len(system.a))),
        np.repeat((conditions.position_noise_m, conditions.angle_noise_rad), 2),
    )
    c[:2], c[2:, TILT] = system.c, 2.0 * np.eye(2)
    # With a delay of one period, what is unknown is the covariance of the prediction.
    gain = system.unknown @ c.T @ np.linalg.inv(c @ system.unknown @ c.T + np.diag(noise**2))
    plant = Helicopter("h1", COAXIAL, conditions, 0, BodyPose((0.0, 0.0, 1.0)), NOMINAL)
    generator = np.random.default_rng(0)
    expected, sticks, places, moved = np.zeros(len(system.a)), np.zeros(2), [], []
    trim = np.array(NOMINAL.trim)
    for _ in range(round(duration_s / PERIOD_S)):
        pose, motion = plant.pose, plant.motion
        measured = np.array(
            (*pose.position_m[:2], pose.roll_rad, pose.pitch_rad)
        ) + noise * generator.standard_normal(4)
        estimate = expected + gain @ (measured - c @ expected)
        expected = system.a @ estimate + system.b @ sticks
        sticks = -feedback @ expected
        climb = (6.0 * (pose.position_m[2] - 1.0) + 5.0 * motion[6] - GRAVITY_M_S2) / NOMINAL.thrust_gain_m_s2
        plant.set_input(np.array((*sticks, -climb, -0.1 * motion[3])) - trim)
        places.append(pose.position_m[:2])
        moved.append(sticks)
        plant.advance(PERIOD_S)
    return np.array(places), np.array(moved)


def test_the_simulated_helicopter_flies_at_the_bound_with_its_regulator() -> None:
    bound = best(hovering(NOMINAL, GUSTS), 0.15)
    places_m, sticks = flown_by_regulator(bound.feedback, GUSTS, 240.0)
    assert rms(places_m[250:]) == pytest.approx(bound.error_m / math.sqrt(2.0), rel=0.07)
    assert rms(sticks[250:]) == pytest.approx(0.15, rel=0.07)


@pytest.mark.parametrize("seed", [100, 101])
def test_no_exactly_known_vehicle_flies_better_than_the_bound_for_more_stick(seed: int) -> None:
    vehicle = replace(CASCADE, knowledge="exact").vehicle("h1", BodyPose((0.0, 0.0, 1.0)), HELICOPTERS, seed)
    flown = Rig([vehicle], HELICOPTERS, seed).fly(15.0)["h1"]
    assert rms(flown.inputs[flown.time_s >= 5.0, :U_THRUST]) < STICKS[0] < STICKS[1] == COAXIAL.input_max[0]
    assert 1e3 * rms(flown.reference_error(5.0)[:, :2]) > hover_mm(STICKS[0], HELICOPTERS, seed)
    assert hover_mm(STICKS[0], HELICOPTERS, seed) > hover_mm(STICKS[1], HELICOPTERS, seed)


@settings(max_examples=5)
@given(st.floats(0.2, 3.0), st.floats(1.05, 2.0))
def test_the_bound_grows_with_turbulence_and_noise_and_falls_with_the_sticks(
    stick: float, factor: float
) -> None:
    x, y, z, yaw = GUSTS.turbulence_rms
    rough = replace(GUSTS, turbulence_rms=(factor * x, factor * y, z, yaw))
    noisy = replace(
        GUSTS,
        position_noise_m=factor * GUSTS.position_noise_m,
        angle_noise_rad=factor * GUSTS.angle_noise_rad,
    )
    both = replace(noisy, turbulence_rms=rough.turbulence_rms)
    error_m = best(hovering(NOMINAL, GUSTS), stick).error_m
    assert best(hovering(NOMINAL, rough), stick).error_m > error_m
    assert best(hovering(NOMINAL, noisy), stick).error_m > error_m
    assert best(hovering(NOMINAL, GUSTS), factor * stick).error_m < error_m
    assert best(hovering(NOMINAL, both), factor * stick).error_m == pytest.approx(factor * error_m, rel=1e-3)


def test_a_follower_errs_more_than_a_vehicle_alone_unless_its_leader_rests() -> None:
    alone = hovering(NOMINAL, GUSTS)
    bound = best(alone, 0.15)
    nothing = np.zeros_like(alone.news)
    resting = changed(alone, news=nothing, unknown=nothing)
    assert best(following(alone, resting, bound.feedback), 0.15).error_m == pytest.approx(
        bound.error_m, rel=1e-3
    )
    assert best(following(alone, alone, bound.feedback), 0.15).error_m > 1.2 * bound.error_m
    assert formation_mm(0.15, HELICOPTERS, 100) > hover_mm(0.15, HELICOPTERS, 100)


def test_linear_motion_is_that_of_the_simulated_helicopter() -> None:
    still = replace(GUSTS, turbulence_rms=(0.0, 0.0, 0.0, 0.0), transport_delay_s=0.0)
    plant = Helicopter(
        "h1", COAXIAL, still, 0, BodyPose((0.0, 0.0, 1.0)), replace(NOMINAL, trim=(0.0, 0.0, 0.0, 0.0))
    )
    plant.set_input((0.02, -0.01, GRAVITY_M_S2 / NOMINAL.thrust_gain_m_s2, 0.0))
    linear, x = continuous(NOMINAL), np.zeros(16)
    x[12:14] = 0.02, -0.01
    for _ in range(500):
        x[:12] += 0.001 * linear @ x
    plant.advance(0.5)
    assert plant.pose.position_m[:2] == pytest.approx(x[:2], rel=0.02)
    assert (plant.pose.roll_rad, plant.pose.pitch_rad) == pytest.approx(2.0 * x[TILT], rel=0.02, abs=1e-4)


def test_bounds_are_refused_where_no_helicopters_fly() -> None:
    result = CliRunner().invoke(app, ["experiment", "bound", "--conditions", "laboratory"])
    assert result.exit_code == 2
    assert "laboratory: no helicopters fly there" in " ".join(result.output.replace("│", " ").split())
