"""The proof of the signs, with vehicles that are their models but for the effects of their sticks."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcopterx.agents.flight.sign_proof import LIFTED_S, READINGS, ROUNDS, SignProof
from rcopterx.agents.flight.timeline import InputHistory
from rcopterx.agents.flight.vehicle_watch import VehicleFault
from rcopterx.control.interfaces import NO_TILT, Estimate, Measurement, TiltEstimate
from rcopterx.control.models.prediction import predict
from rcopterx.fleet.vehicle_types import vehicle_type
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW, YAW, YAW_RATE, Array

TYPES = ["coaxial", "crazyflie", "betaflight", "mavlink_quadrotor", "ardupilot_quadrotor", "coaxial_lag"]
PERIOD_S = 0.02


class Flown:
    """One proof of a vehicle whose sticks have `effects`, shape (2, 2), and `yaw_effect`."""

    def __init__(
        self, model: Model, effects: Array, yaw_effect: float = 1.0, *, gain: float = 1.0, seed: int = 1,
        position_noise_m: float = 0.0003, measured_tilt: bool = True, trim: tuple[float, float] = (0.0, 0.0),
        turned_rad: float = 0.0, later_s: float = 0.0,
    ) -> None:  # fmt: skip
        self.model, self.random = model, random.Random(seed)
        factors = (gain, gain, 1.0, gain)
        self.truth = replace(
            model, input_gain=tuple(b * k for b, k in zip(model.input_gain, factors, strict=True))
        )
        self.effects, self.yaw_effect, self.trim, self.turned_rad = effects, yaw_effect, trim, turned_rad
        self.noise_m, self.measured_tilt = position_noise_m, measured_tilt
        self.proof = SignProof(model, measured_tilt=measured_tilt)
        tilt = NO_TILT
        if model.tilt is not None:
            tilt = TiltEstimate(np.zeros(model.tilt.dynamics().size), *3 * [np.zeros(2)])
        self.estimate = Estimate(np.zeros(8), model.hover_input.copy(), np.zeros(4), tilt)
        self.inputs, self.applied = (InputHistory(model.hover_input.copy()) for _ in range(2))
        self.time_s, self.later_s = 0.0, later_s
        risen = model.hover_input.copy()
        risen[:2] = trim
        self.estimate = predict(self.truth, self.estimate, risen, LIFTED_S)

    def until_judged(self, limit_s: float) -> VehicleFault | None:
        """Fly until the proof ends, or is found wanting."""
        self.proof.begin(self.time_s)
        while self.proof.under_way and self.time_s < limit_s:
            self.proof.observe(self.measured(), self.inputs, self.time_s)
            fault = self.proof.judge(self.time_s)
            if fault is not None:
                return fault
            commanded = self.proof.pulses(self.model.hover_input[None, :].copy(), self.time_s, PERIOD_S)[0]
            acts_s, number = self.time_s + self.model.delay_s, round(self.time_s / PERIOD_S)
            self.inputs.append(acts_s, number, commanded)
            self.applied.append(acts_s + self.later_s, number, commanded)
            for value, duration_s in self.applied.between(self.time_s, self.time_s + PERIOD_S):
                applied = value.copy()
                applied[:2] = self.effects @ value[:2] + self.trim
                applied[U_YAW] *= self.yaw_effect
                self.estimate = predict(self.truth, self.estimate, applied, duration_s)
            self.time_s += PERIOD_S
        return None

    def measured(self) -> Measurement:
        noise = self.random.gauss
        position_m = self.estimate.motion[:3] + [noise(0.0, self.noise_m) for _ in range(3)]
        yaw_rad = math.remainder(self.estimate.motion[YAW] + self.turned_rad + noise(0.0, 0.002), math.tau)
        tilt = None
        if self.measured_tilt and self.estimate.has_tilt:
            tilt = self.estimate.tilt.core[:2] + np.array([noise(0.0, 0.002), noise(0.0, 0.002)])
        return Measurement(position_m, yaw_rad, tilt)


@pytest.mark.parametrize("kind", TYPES)
@settings(max_examples=10, deadline=None)
@given(
    gain=st.floats(1 / 1.5, 1.5),
    seed=st.integers(0, 1000),
    turned_rad=st.floats(-0.6, 0.6),
    trim=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
)
def test_a_sound_vehicle_is_proved_in_one_round(
    kind: str, gain: float, seed: int, turned_rad: float, trim: tuple[float, float]
) -> None:
    flown = Flown(vehicle_type(kind).model, np.eye(2), gain=gain, seed=seed, turned_rad=turned_rad, trim=trim)
    assert flown.until_judged(flown.proof.round_s + 2 * PERIOD_S) is None
    assert not flown.proof.under_way


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("reading", READINGS[1:], ids=lambda reading: reading[1].split(":")[0])
@settings(max_examples=3, deadline=None)
@given(gain=st.floats(1 / 1.5, 1.5), seed=st.integers(0, 1000), measured_tilt=st.booleans())
def test_a_wrong_sign_is_named_in_one_round(
    kind: str, reading: tuple[Array, str], gain: float, seed: int, measured_tilt: bool
) -> None:
    effects, text = reading
    flown = Flown(vehicle_type(kind).model, effects, gain=gain, seed=seed, measured_tilt=measured_tilt)
    fault = flown.until_judged(flown.proof.round_s + 2 * PERIOD_S)
    assert fault == VehicleFault("sign_wrong", text, (U_PITCH, U_ROLL))


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("later_s", [0.02, 0.04, 0.06])
@settings(max_examples=5, deadline=None)
@given(gain=st.floats(1 / 1.5, 1.5), seed=st.integers(0, 1000))
def test_answers_that_are_later_than_the_model_says_blame_no_stick(
    kind: str, later_s: float, gain: float, seed: int
) -> None:
    flown = Flown(vehicle_type(kind).model, np.eye(2), gain=gain, seed=seed, later_s=later_s)
    assert flown.until_judged(ROUNDS * (flown.proof.round_s + 2 * PERIOD_S)) is None
    assert not flown.proof.under_way


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize(("quarters", "side"), [(1, "to the left"), (2, "backwards"), (-1, "to the right")])
def test_a_subject_whose_nose_points_elsewhere_is_named(kind: str, quarters: int, side: str) -> None:
    flown = Flown(vehicle_type(kind).model, np.eye(2), turned_rad=0.5 * math.pi * quarters)
    fault = flown.until_judged(flown.proof.round_s + 2 * PERIOD_S)
    assert fault is not None
    assert fault.text.endswith(f"the nose of the subject points {side}?")


@pytest.mark.parametrize("kind", TYPES)
@settings(max_examples=5, deadline=None)
@given(gain=st.floats(1 / 1.5, 1.5), seed=st.integers(0, 1000))
def test_a_reversed_yaw_is_named_in_one_round(kind: str, gain: float, seed: int) -> None:
    flown = Flown(vehicle_type(kind).model, np.eye(2), -1.0, gain=gain, seed=seed)
    fault = flown.until_judged(flown.proof.round_s + 2 * PERIOD_S)
    assert fault is not None
    assert fault.axes == (U_YAW,)
    assert "yaw acts the wrong way" in fault.text


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("axis", ["pitch", "roll"])
def test_a_stick_without_effect_ends_the_proof(kind: str, axis: str) -> None:
    effects = np.diag([0.0 if axis == "pitch" else 1.0, 0.0 if axis == "roll" else 1.0])
    flown = Flown(vehicle_type(kind).model, effects)
    fault = flown.until_judged(ROUNDS * (flown.proof.round_s + 2 * PERIOD_S))
    assert fault is not None
    seen = vehicle_type(kind).model.tilt is not None
    assert (
        fault.text in [f"{axis} has no effect", "pitch and roll do not act as modelled"][: 1 if seen else 2]
    )


@pytest.mark.parametrize("kind", TYPES)
def test_a_yaw_without_effect_is_left_to_the_watch_in_flight(kind: str) -> None:
    flown = Flown(vehicle_type(kind).model, np.eye(2), 0.0)
    assert flown.until_judged(ROUNDS * (flown.proof.round_s + 2 * PERIOD_S)) is None
    assert not flown.proof.under_way


@pytest.mark.parametrize("kind", TYPES)
def test_pulses_leave_no_velocity_and_move_nothing_but_open_sticks(kind: str) -> None:
    model = vehicle_type(kind).model
    proof, hover = SignProof(model), model.hover_input[None, :].copy()
    proof.begin(0.0)
    rows = np.vstack([proof.pulses(hover, 0.1 * number + 0.05, PERIOD_S) for number in range(10)])
    np.testing.assert_allclose(rows.sum(axis=0)[[U_PITCH, U_ROLL, U_YAW]], 0.0, atol=1e-12)
    assert (rows[:, U_THRUST] == hover[0, U_THRUST]).all()
    assert (np.abs(rows - hover) <= 0.5 * model.stick_room + 1e-12).all()


def test_the_heading_turns_the_sticks_of_a_vehicle_that_spins() -> None:
    model = vehicle_type("crazyflie").model
    flown = Flown(model, np.diag((-1.0, 1.0)))
    flown.estimate.motion[YAW_RATE] = 3.0
    fault = flown.until_judged(flown.proof.round_s)
    assert fault is not None
    assert fault.text.startswith("pitch acts the wrong way")
