"""The rule of the weights keeps its promise for every vehicle within reason."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL, COAXIAL_LAG, CRAZYFLIE, QUADROTOR, TYPES

from rcopterx.control.controllers.cascade.weights import (
    DEMAND_FLOOR,
    LOOP_DEMAND_FLOOR,
    default_weights,
)
from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import FeedbackLoop, Perturbation, robustness
from rcopterx.vehicles.model import IDENTIFIED, UNIDENTIFIED, Model, Uncertainty, damping_range
from rcopterx.vehicles.state import U_THRUST, U_YAW
from rcopterx.vehicles.tilt import TiltModel

PERIOD_S = 0.02


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


BARS = st.fixed_dictionaries(
    {
        "bar_time_constant_s": between(0.8, 2.0),
        "upper_phase_rad": between(-0.2, 0.1),
        "lower_phase_rad": between(0.1, 0.45),
        "upper_share": between(0.1, 0.4),
        "direct_m": between(0.0, 0.02),
    }
)
TILTS = st.builds(
    lambda frequency, damping, servo, bar: TiltModel(frequency, damping, servo, **bar),
    between(8.0, 30.0),
    between(0.1, 1.0),
    between(0.01, 0.05),
    BARS | st.just({}),
)
VEHICLES = st.builds(
    lambda tilt, gain, delay_s, lag_s, uncertainty: replace(
        COAXIAL,
        tilt=tilt,
        input_gain=(gain, 1.1 * gain, 18.0, 111.0),
        delay_s=delay_s,
        lag_s=(0.12, 0.12, lag_s, lag_s),
        uncertainty=uncertainty,
    ),
    TILTS,
    between(1.0, 8.0),
    between(0.0, 0.06),
    between(0.03, 0.15),
    st.sampled_from((UNIDENTIFIED, IDENTIFIED)),
)


def bears(loop: FeedbackLoop) -> bool:
    return robustness(loop).shortage == 0


def bears_its_uncertainty(model: Model) -> dict[str, bool]:
    states, efforts = default_weights(model, PERIOD_S)
    loops = {
        axis: lag_loop(model, PERIOD_S, axis, (states[axis], states[4 + axis], efforts[axis]))
        for axis in range(4)
    }
    borne = {name: bears(loops[axis]) for axis, name in ((2, "height"), (3, "yaw"))}
    if model.tilt is None:
        return borne | {name: bears(loops[axis]) for axis, name in ((0, "x"), (1, "y"))}
    demand = efforts[0] / model.input_gain[0] ** 2
    tilted = tilt_loop(model, PERIOD_S, (states[0], states[4], demand))
    return borne | {"horizontal": bears(tilted)}


@settings(max_examples=settings().max_examples // 2)
@given(VEHICLES)
def test_every_vehicle_within_reason_bears_the_uncertainty_of_its_model(model: Model) -> None:
    borne = bears_its_uncertainty(model)
    assert all(borne.values()), borne


@pytest.mark.parametrize("model", TYPES.values(), ids=TYPES)
@pytest.mark.parametrize("uncertainty", [UNIDENTIFIED, IDENTIFIED])
def test_every_type_bears_it(model: Model, uncertainty: Uncertainty) -> None:
    known = replace(uncertainty, tilt_damping=model.uncertainty.tilt_damping)
    assert all(bears_its_uncertainty(replace(model, uncertainty=known)).values())


def test_what_is_better_known_is_flown_harder() -> None:
    loose, tight = (
        default_weights(replace(COAXIAL, uncertainty=known), PERIOD_S).inputs
        for known in (UNIDENTIFIED, IDENTIFIED)
    )
    assert tight[0] < loose[0] / 5
    assert tight[2] < loose[2]


def test_a_stick_of_twice_the_gain_has_four_times_the_weight() -> None:
    twice = replace(COAXIAL, input_gain=(4.0, 4.2, 18.0, 111.0))
    light, heavy = (default_weights(model, PERIOD_S).inputs for model in (COAXIAL, twice))
    assert heavy[:2] == pytest.approx([4 * weight for weight in light[:2]])
    assert light[0] >= DEMAND_FLOOR * 4.0


def test_a_tilt_under_an_attitude_loop_is_flown_harder_than_one_with_a_bar() -> None:
    demand = default_weights(CRAZYFLIE, PERIOD_S).inputs[0] / CRAZYFLIE.b[0] ** 2
    assert LOOP_DEMAND_FLOOR <= demand < default_weights(COAXIAL, PERIOD_S).inputs[0] / COAXIAL.b[0] ** 2 / 2
    assert all(bears_its_uncertainty(CRAZYFLIE).values())


def test_a_slow_lightly_damped_vehicle_with_a_long_delay_is_flown_softer() -> None:
    assert COAXIAL.tilt is not None
    slow = replace(COAXIAL.tilt, frequency_rad_s=8.0, damping_ratio=0.05, servo_lag_s=0.04)
    hard = replace(COAXIAL, tilt=slow, delay_s=0.05)
    floor = default_weights(COAXIAL, PERIOD_S).inputs[0]
    assert default_weights(hard, PERIOD_S).inputs[0] > 1.4 * floor


def lightly_damped(damping_ratio: float = 0.11, flapping_rad_s_m: float = 5.2) -> Model:
    """An identified helicopter whose joint corners no weight of its sticks alone makes stable."""
    tilt = TiltModel(
        14.4, damping_ratio, 0.0264, bar_time_constant_s=1.18, upper_phase_rad=-0.161, lower_phase_rad=0.298,
        upper_share=0.248, direct_m=0.00714, flapping_rad_s_m=flapping_rad_s_m,
    )  # fmt: skip
    return replace(
        COAXIAL,
        tilt=tilt,
        input_gain=(2.0, 1.96, 17.0, 92.0),
        damping=(-0.38, -0.34, 0.0, -4.5),
        delay_s=0.019,
        uncertainty=replace(IDENTIFIED, tilt_damping=damping_range(damping_ratio)),
    )


def test_a_lightly_damped_vehicle_bears_its_uncertainty_by_a_weight_of_its_velocity() -> None:
    model = lightly_damped()
    weights = default_weights(model, PERIOD_S)
    assert weights.inputs[0] < 1.5 * DEMAND_FLOOR * model.input_gain[0] ** 2
    assert weights.states[4] == weights.states[5] > 1.0
    assert all(bears_its_uncertainty(model).values())


@settings(max_examples=settings().max_examples // 10)
@given(between(0.02, 0.15), between(2.0, 13.0))
def test_no_identified_helicopter_is_flown_softer_than_its_type(damping: float, flapping: float) -> None:
    softest = default_weights(COAXIAL, PERIOD_S).inputs[0] / COAXIAL.input_gain[0] ** 2
    model = lightly_damped(damping, flapping)
    assert default_weights(model, PERIOD_S).inputs[0] / model.input_gain[0] ** 2 <= softest


@pytest.mark.parametrize(
    ("frequency_rad_s", "damping_ratio"),
    [(9.0, 0.5), (10.8, 0.1), (13.0, 0.1), (13.0, 0.5), (18.0, 0.1), (18.0, 0.5)],
)
def test_type_bears_tilts_of_its_family_with_a_period_more_delay(
    frequency_rad_s: float, damping_ratio: float
) -> None:
    """A tilt that is slow and lightly damped at once is for the guard: `test_guard_flights.py`."""
    assert COAXIAL.tilt is not None
    tilt = replace(COAXIAL.tilt, frequency_rad_s=frequency_rad_s, damping_ratio=damping_ratio)
    demand = default_weights(COAXIAL, PERIOD_S).inputs[0] / COAXIAL.b[0] ** 2
    weights = (100.0, default_weights(COAXIAL, PERIOD_S).states[4], demand)
    flown = tilt_loop(COAXIAL, PERIOD_S, weights)
    true = tilt_loop(replace(COAXIAL, tilt=tilt), PERIOD_S, weights)
    assert replace(flown, plant_step=true.plant_step).stable(Perturbation(delay_s=0.02))


@pytest.mark.parametrize("axis", [U_THRUST, U_YAW])
def test_type_bears_slow_rotors_large_gain_and_delay_together(axis: int) -> None:
    states, efforts = default_weights(COAXIAL, PERIOD_S)
    weights = (states[axis], states[4 + axis], efforts[axis])
    slow = replace(COAXIAL, lag_s=(0.12, 0.12, *(1.3 * lag_s for lag_s in COAXIAL.lag_s[2:])))
    flown, true = (lag_loop(model, PERIOD_S, axis, weights) for model in (COAXIAL, slow))
    assert replace(flown, plant_step=true.plant_step).stable(Perturbation(gain=1.3, delay_s=0.02))


def test_type_bears_a_gyro_that_hardly_damps() -> None:
    states, efforts = default_weights(COAXIAL, PERIOD_S)
    weights = (states[U_YAW], states[4 + U_YAW], efforts[U_YAW])
    weak = replace(COAXIAL, damping=(-0.5, -0.4, 0.0, -0.5))
    flown, true = (lag_loop(model, PERIOD_S, U_YAW, weights) for model in (COAXIAL, weak))
    assert replace(flown, plant_step=true.plant_step).stable()


@pytest.mark.parametrize("model", [COAXIAL_LAG, replace(QUADROTOR, tilt=None)])
def test_a_weight_less_than_the_rules_falls_short(model: Model) -> None:
    loose = replace(model, uncertainty=UNIDENTIFIED)
    effort = default_weights(loose, PERIOD_S).inputs[0]
    loop = lag_loop(loose, PERIOD_S, 1, (800.0, 1.0, effort / 1.16))
    assert not bears(loop)


def test_what_is_less_certain_is_flown_softer_step_by_step() -> None:
    of_type = COAXIAL.uncertainty
    efforts = [
        default_weights(
            replace(COAXIAL, uncertainty=replace(of_type, gain_factor=(factor, *of_type.gain_factor[1:]))),
            PERIOD_S,
        ).inputs[0]
        for factor in (1.3, 1.35, 1.4, 1.45, 1.5, 1.6, 1.65, 1.7)
    ]
    assert efforts == sorted(efforts)
    assert efforts[-1] < 2.5 * default_weights(COAXIAL, PERIOD_S).inputs[0]
