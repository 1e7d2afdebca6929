"""Models that pilots get of their vehicles."""

from dataclasses import replace

import numpy as np
import pytest
from support.conditions import CRAZYFLIES, HELICOPTERS, IDEAL, LABORATORY
from support.vehicle_types import COAXIAL, COAXIAL_LAG, CRAZYFLIE

from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.prediction import predict
from rcopterx.simulator.helicopter import Helicopter, helicopter_of
from rcopterx.simulator.plant import CALM, BodyPose
from rcopterx.vehicles.model import IDENTIFIED, UNIDENTIFIED
from rcopterx.vehicles.state import YAW_RATE, heading_matrix
from rcopterx_studies.experiments.knowledge import exact_crazyflie, exact_model, known_model
from rcopterx_studies.experiments.rig import Rig
from rcopterx_studies.experiments.schemes import CASCADE
from rcopterx_studies.plants.identified_crazyflie import IDENTIFIED as IDENTIFIED_CRAZYFLIES
from rcopterx_studies.plants.identified_crazyflie import CrazyfliePlant, IdentifiedCrazyflie, crazyflie_of

STEP_S = 0.001
PERIOD_S = 0.02


@pytest.mark.parametrize("seed", [0, 3, 7])
def test_exact_model_predicts_the_flight_of_a_drawn_helicopter(seed: int) -> None:
    drawn = helicopter_of("h1", HELICOPTERS, seed)
    lag_s = sum(drawn.servo_lag_s) / 2
    straight = replace(drawn, servo_step=0.0, servo_lag_s=(lag_s, lag_s), trim=(0.0, 0.0, 0.0, 0.0))
    model = exact_model(straight)
    assert model.tilt is not None
    calm = replace(IDEAL, transport_delay_s=0.0)
    plant = Helicopter("h1", COAXIAL, calm, 0, BodyPose((0.0, 0.0, 5.0)), straight)
    stick = np.array([0.1, -0.05])
    plant.set_input((*stick.tolist(), model.hover_input[2], 0.0))

    tilt = model.tilt.dynamics()
    core, servo, velocity = np.zeros(tilt.size), np.zeros(2), np.zeros(2)
    flown, predicted = [], []
    for step in range(600):
        servo = servo + STEP_S / lag_s * (stick - servo)
        demand = heading_matrix(plant.motion[3]) @ (model.b[:2] * servo)  # the gyro lets it turn a little
        velocity = velocity + STEP_S * (tilt.c @ core + tilt.d @ demand + model.k[:2] * velocity)
        core = core + STEP_S * (tilt.a @ core + tilt.b @ demand)
        plant.advance(STEP_S)
        if step % 100 == 99:
            predicted.append(velocity)
            flown.append(plant.state[3:5])
    assert np.abs(np.array(flown) - predicted).max() < 0.08 * np.abs(flown).max()


@pytest.mark.parametrize("seed", [0, 3, 7])
def test_exact_model_predicts_how_thrust_and_yaw_stick_turn_a_drawn_helicopter(seed: int) -> None:
    drawn = replace(helicopter_of("h1", HELICOPTERS, seed), trim=(0.0, 0.0, 0.0, 0.0))
    model, calm = exact_model(drawn), replace(IDEAL, transport_delay_s=0.0)
    hover = model.hover_input
    plant = Helicopter("h1", COAXIAL, calm, 0, BodyPose((0.0, 0.0, 5.0)), drawn)
    plant.set_input(tuple(hover.tolist()))
    plant.advance(1.0)
    predicted = Estimate(np.array(plant.motion), hover, np.zeros(4))
    rates = []
    for step in range(40):
        stick = hover + np.array([0.0, 0.0, 0.05, 0.02 if step >= 20 else 0.0])
        plant.set_input(tuple(stick.tolist()))
        plant.advance(PERIOD_S)
        predicted = predict(model, predicted, stick, PERIOD_S)
        rates.append((plant.motion[YAW_RATE], predicted.motion[YAW_RATE]))
    flown, expected = np.array(rates).T
    assert np.abs(flown).max() > 0.2
    assert np.abs(flown - expected).max() < 0.12 * np.abs(flown).max()


@pytest.mark.parametrize("drone", IDENTIFIED_CRAZYFLIES)
def test_the_type_of_crazyflies_covers_the_identified_ones(drone: str) -> None:
    true, may = exact_crazyflie(IdentifiedCrazyflie(drone)), CRAZYFLIE.uncertainty
    assert true.tilt is not None
    assert CRAZYFLIE.tilt is not None
    for own, nominal in zip(true.input_gain[:3], CRAZYFLIE.input_gain[:3], strict=True):
        assert max(own / nominal, nominal / own) < may.gain_factor[0]
    low, high = may.tilt_damping or (0.0, 0.0)
    assert low < true.tilt.damping_ratio < high
    assert true.tilt.frequency_rad_s == pytest.approx(
        CRAZYFLIE.tilt.frequency_rad_s, rel=may.frequency_fraction[0]
    )


@pytest.mark.parametrize("seed", [0, 3])
def test_exact_model_predicts_the_flight_of_a_drawn_crazyflie(seed: int) -> None:
    drawn = replace(crazyflie_of("h1", CRAZYFLIES, seed), trim=CALM)
    model, calm = exact_crazyflie(drawn), replace(IDEAL, transport_delay_s=0.0)
    hover = model.hover_input
    plant = CrazyfliePlant("h1", CRAZYFLIE, calm, 0, BodyPose((0.0, 0.0, 5.0)), drawn)
    plant.set_input(tuple(hover.tolist()))
    plant.advance(1.0)
    predicted = Estimate(np.array(plant.motion), hover, np.zeros(4))
    flown, expected = [], []
    for step in range(50):
        stick = hover + np.array([0.1, -0.05, 0.03, 0.2 if step >= 20 else 0.0])
        plant.set_input(tuple(stick.tolist()))
        plant.advance(PERIOD_S)
        predicted = predict(model, predicted, stick, PERIOD_S)
        flown.append(plant.motion[4:])
        expected.append(predicted.motion[4:])
    errors = np.abs(np.array(flown) - expected).max(axis=0)
    assert (errors < 0.1 * np.abs(flown).max(axis=0)).all()


def test_pilots_know_the_type_or_the_truth() -> None:
    def known(knowledge: str) -> object:
        return known_model(knowledge, HELICOPTERS, "h1", 100)  # type: ignore[arg-type]  # of the table

    assert known("default") is COAXIAL
    assert COAXIAL.uncertainty == replace(UNIDENTIFIED, tilt_damping=(0.1, 0.5))
    assert known("exact") == exact_model(helicopter_of("h1", HELICOPTERS, 100))
    exact = exact_model(helicopter_of("h1", HELICOPTERS, 100))
    assert replace(exact.uncertainty, tilt_damping=None) == IDENTIFIED
    assert known_model("default", CRAZYFLIES, "h1", 100) is CRAZYFLIE
    assert known_model("exact", CRAZYFLIES, "h1", 100) == exact_crazyflie(crazyflie_of("h1", CRAZYFLIES, 100))


def test_first_order_plants_are_known_by_their_nominal_parameters_only() -> None:
    assert known_model("default", LABORATORY, "h1", 0) is COAXIAL_LAG
    with pytest.raises(ValueError, match="by default only"):
        known_model("exact", LABORATORY, "h1", 0)


def test_knowledge_of_the_pilot_does_not_change_the_plant() -> None:
    schemes = (CASCADE, replace(CASCADE, knowledge="exact"))
    states = []
    for scheme in schemes:
        vehicle = replace(scheme, horizon=10).vehicle("h1", BodyPose((0.0, 0.0, 1.0)), HELICOPTERS, 3)
        rig = Rig([vehicle], HELICOPTERS, 3)
        plant = rig.laboratory.plants["h1"]
        plant.set_input((0.3, 0.0, 0.5, 0.0))
        plant.advance(0.1)
        states.append(plant.motion)
    assert len(set(states)) == 1
