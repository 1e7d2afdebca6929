"""Promises of the helicopter's equations of motion."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.records import replace as changed

from rcopterx.simulator.helicopter_dynamics import (
    Controls,
    HelicopterState,
    airframe_of,
    commanded_speeds,
    derivative,
    level_state,
    rotor_thrusts,
    step,
    swash_target,
)
from rcopterx.simulator.helicopter_parameters import NOMINAL_PLATEAU_M_S2, HelicopterParameters, Rotors
from rcopterx.vehicles.state import GRAVITY_M_S2, Array, heading_matrix

CALM = 6 * (0.0,)
HIGH = (0.0, 0.0, 50.0)
HOVER = (GRAVITY_M_S2 / 18.0, 0.0)
STEP_S = 0.004
sizes = st.floats(0.6, 1.0)


def hovering(vehicle: HelicopterParameters, yaw_rad: float = 0.0) -> HelicopterState:
    return level_state(HIGH, yaw_rad, vehicle.hover_speeds_rad_s)


def flown(
    vehicle: HelicopterParameters,
    state: HelicopterState,
    seconds: float,
    swash: tuple[float, float] = (0.0, 0.0),
    throttle: tuple[float, float] | None = HOVER,
    step_s: float = STEP_S,
) -> HelicopterState:
    airframe, controls = (
        airframe_of(vehicle),
        Controls(*swash, throttle is not None, *(throttle or (0.0, 0.0))),
    )
    for _ in range(round(seconds / step_s)):
        state = step(airframe, state, controls, 1.0, CALM, step_s)
    return state


def mast(state: HelicopterState) -> Array:
    w, x, y, z = state[6:10]
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


def hovering_rate(vehicle: HelicopterParameters, state: HelicopterState) -> Array:
    return np.array(derivative(airframe_of(vehicle), state, Controls(0.0, 0.0, True, *HOVER), 1.0, CALM))


def linearised(vehicle: HelicopterParameters) -> Array:
    start = np.array(hovering(vehicle))

    def rate(state: Array) -> Array:
        return hovering_rate(vehicle, HelicopterState(*state.tolist()))

    steps = 1e-5 * np.eye(len(start))
    return np.array([(rate(start + step) - rate(start - step)) / 2e-5 for step in steps]).T


@given(size=sizes)
def test_hover_speeds_of_the_published_vehicle_are_an_equilibrium(size: float) -> None:
    vehicle = HelicopterParameters.nominal(size)
    assert np.multiply(vehicle.hover_speeds_rad_s, size) == pytest.approx((227.0, 239.0), abs=0.5)
    assert np.abs(hovering_rate(vehicle, hovering(vehicle))).max() < 1e-9


@pytest.mark.parametrize(("size", "fast_rad_s"), [(1.0, 10.0), (0.75, 13.3)])
def test_small_motions_have_the_fast_mode_and_the_creep_of_the_published_vehicle(
    size: float, fast_rad_s: float
) -> None:
    vehicle = replace(HelicopterParameters.nominal(size), added_damping=0.0, flapping_rad_s_m=0.0)
    assert vehicle.fast_mode_rad_s == pytest.approx(fast_rad_s, rel=0.01)
    eigenvalues = np.linalg.eigvals(linearised(vehicle))
    fast = [value for value in eigenvalues if value.imag > 0.7 * fast_rad_s]
    assert len(fast) == 2
    assert np.abs(fast) == pytest.approx([fast_rad_s] * 2, rel=0.02)
    # The phase lag of the upper rotor takes damping from one sense of circling and gives it to the other.
    ratios = sorted(-value.real / abs(value) for value in fast)
    bar = 1 / (2 * fast_rad_s * vehicle.bar_time_constant_s)
    coupling = math.sin(abs(vehicle.hover_phases_rad[0]) / 2)
    assert ratios == pytest.approx([bar - coupling, bar + coupling], abs=0.003)


def test_added_damping_is_a_damping_ratio_of_the_fast_mode() -> None:
    def ratios(damping: float) -> Array:
        vehicle = replace(HelicopterParameters.nominal(), added_damping=damping)
        values = np.linalg.eigvals(linearised(vehicle))
        return np.sort([-v.real / abs(v) for v in values if v.imag > 10.0])

    assert ratios(0.3) - ratios(0.0) == pytest.approx([0.3, 0.3], abs=0.02)


def test_step_of_the_pitch_stick_tilts_as_published() -> None:
    vehicle = replace(HelicopterParameters.nominal(), added_damping=0.2)
    swash = swash_target(vehicle, 0.1, 0.0)
    state, tilts, speeds = hovering(vehicle), [], []
    for duration in (0.1, 0.2, 0.2, 0.5, 1.0):
        state = flown(vehicle, state, duration, swash)
        tilts.append(math.degrees(math.asin(mast(state)[0])))
        speeds.append(state.vx)
    assert tilts[:3] == pytest.approx([0.5, 1.9, 1.3], abs=0.1)
    assert tilts[2] < tilts[3] < tilts[4], "creeps up with the bar"
    assert speeds[1] == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize("axis", [0, 1])
@given(size=sizes)
@settings(max_examples=5, deadline=None)
def test_stick_has_the_gain_of_the_identified_vehicle_before_the_bar_creeps(axis: int, size: float) -> None:
    # A bar that never follows the mast leaves the plateau standing.
    vehicle = replace(
        HelicopterParameters.nominal(size),
        bar_time_constant_s=1e6,
        drag_per_s=(0.0, 0.0),
        flapping_rad_s_m=0.0,
    )
    swash = swash_target(vehicle, *(0.01 * np.eye(2)[axis]))
    state = flown(vehicle, hovering(vehicle), 4.0, swash)
    later = flown(vehicle, state, 1.0, swash)
    acceleration = np.subtract(later[3:5], state[3:5])[axis] / 0.01
    assert acceleration == pytest.approx(NOMINAL_PLATEAU_M_S2[axis], rel=0.01)


def test_servos_act_along_axes_that_are_turned_each_by_its_own_angle() -> None:
    straight = HelicopterParameters.nominal()
    turned = replace(straight, servo_axes_rad=(-0.3, -0.6))
    for axis, angle_rad in enumerate(turned.servo_axes_rad):
        sticks = 0.02 * np.eye(2)[axis]
        expected = heading_matrix(angle_rad) @ swash_target(straight, *sticks)
        assert swash_target(turned, *sticks) == pytest.approx(expected)


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
@pytest.mark.parametrize("phase_rad", [0.0, -0.7])
def test_airspeed_tilts_the_vehicle_against_it(phase_rad: float, yaw_rad: float) -> None:
    vehicle = replace(HelicopterParameters.nominal(), flapping_phase_rad=phase_rad)
    airframe, state = airframe_of(vehicle), hovering(vehicle, yaw_rad)
    hover = Controls(0.0, 0.0, True, *HOVER)

    def tilting(state: HelicopterState, air: tuple[float, ...]) -> Array:
        """Angular acceleration of the mast towards inertial x and y."""
        rate = derivative(airframe, state, hover, 1.0, air)
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        return np.array((c * rate.q + s * rate.p, s * rate.q - c * rate.p))

    still = tilting(state, CALM)
    flying = tilting(changed(state, vx=0.4, vy=-0.2), CALM) - still
    against = vehicle.flapping_rad_s_m * np.array((-0.4, 0.2))
    assert flying == pytest.approx(heading_matrix(phase_rad) @ against)
    drag = sum(vehicle.drag_per_s) / 2
    gust = tilting(state, (0.4 * drag, -0.2 * drag, 0.0, 0.0, 0.0, 0.0)) - still
    assert gust == pytest.approx(-flying)


@given(thrust=st.floats(0.2, 1.0))
@settings(max_examples=10, deadline=None)
def test_thrust_is_linear_in_the_stick(thrust: float) -> None:
    vehicle = HelicopterParameters.nominal()
    speeds = commanded_speeds(airframe_of(vehicle), thrust, 0.0, 0.0, 1.0)
    assert sum(rotor_thrusts(airframe_of(vehicle), *speeds, 50.0)) / vehicle.mass_kg == pytest.approx(
        18.0 * thrust
    )


def test_yaw_gyro_holds_the_rate_that_the_stick_asks_for() -> None:
    vehicle = HelicopterParameters.nominal()
    state = flown(vehicle, hovering(vehicle), 3.0, throttle=(HOVER[0], 0.1))
    assert state.r == pytest.approx(0.1 * 111 / 5, rel=0.01)


@pytest.mark.parametrize(("hold_per_s", "turned_rad"), [(0.0, 0.2), (2.0, 0.0)])
def test_heading_hold_turns_the_vehicle_back_after_a_push(hold_per_s: float, turned_rad: float) -> None:
    vehicle = replace(HelicopterParameters.nominal(), yaw_hold_per_s=hold_per_s)
    state = flown(vehicle, changed(hovering(vehicle), r=1.0), 5.0)
    assert 2 * math.atan2(state.qz, state.qw) == pytest.approx(turned_rad, abs=0.01)


def test_yaw_stick_acts_as_identified_where_the_rotors_are_fast() -> None:
    vehicle = replace(HelicopterParameters.nominal(), rotor_lag_s=Rotors(0.01, 0.01))
    state = hovering(vehicle)
    rates = []
    for _ in range(4):
        state = flown(vehicle, state, 0.1, throttle=(HOVER[0], 0.1))
        rates.append(state.r)
    late = 0.01
    identified = [0.1 * 111 / 5 * (1 - math.exp(-5 * (0.1 * n - late))) for n in range(1, 5)]
    assert rates == pytest.approx(identified, rel=0.05)


@given(rates=st.tuples(*[st.floats(-8, 8)] * 3), velocity=st.tuples(*[st.floats(-3, 3)] * 3))
@settings(max_examples=15, deadline=None)
def test_body_without_rotors_and_air_keeps_its_energy_and_angular_momentum(
    rates: tuple[float, ...], velocity: tuple[float, ...]
) -> None:
    vehicle = replace(
        HelicopterParameters.nominal(),
        spring_n_m=Rotors(1e-12, 1e-12),
        drag_per_s=(0.0, 0.0),
        flapping_rad_s_m=0.0,
        added_damping=0.0,
    )
    inertia = np.array(vehicle.inertia_kg_m2)

    def conserved(state: HelicopterState) -> tuple[float, Array]:
        motion = vehicle.mass_kg * (0.5 * np.sum(np.square(state[3:6])) + GRAVITY_M_S2 * state[2])
        body = np.array(state[10:13])
        w, x, y, z = state[6:10]
        momentum = Rotation.from_quat([x, y, z, w]).apply(inertia * body)
        return float(motion + 0.5 * inertia @ body**2), momentum

    rest = level_state(HIGH, 0.4, (0.0, 0.0))
    vx, vy, vz = velocity
    p, q, r = rates
    start = changed(rest, vx=vx, vy=vy, vz=vz, p=p, q=q, r=r)
    end = flown(vehicle, start, 0.5, throttle=None)
    energy, momentum = conserved(start)
    energy_later, momentum_later = conserved(end)
    assert energy_later == pytest.approx(energy, rel=1e-5)
    assert momentum_later == pytest.approx(momentum, abs=2e-3 * float(np.linalg.norm(momentum)) + 1e-9)


@given(yaw=st.floats(-3, 3), pitch=st.floats(-1, 1), roll=st.floats(-1, 1))
@settings(max_examples=15, deadline=None)
def test_flight_does_not_depend_on_the_heading(yaw: float, pitch: float, roll: float) -> None:
    vehicle = HelicopterParameters.nominal()
    swash = swash_target(vehicle, pitch, roll)
    north = flown(vehicle, hovering(vehicle), 0.6, swash)
    turned = flown(vehicle, hovering(vehicle, yaw), 0.6, swash)
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = north[:2]
    assert turned[:2] == pytest.approx((c * x - s * y, s * x + c * y), abs=1e-7)
    assert turned[10:15] == pytest.approx(north[10:15], abs=1e-6)


@given(angle=st.floats(0.01, 3.0), size=sizes)
@settings(max_examples=10, deadline=None)
def test_angle_of_the_bar_to_the_mast_decays_along_the_great_circle(angle: float, size: float) -> None:
    vehicle = HelicopterParameters.nominal(size)
    state = changed(
        level_state(HIGH, 0.0, (0.0, 0.0)),
        bar_x=0.6 * math.sin(angle),
        bar_y=0.8 * math.sin(angle),
        bar_z=math.cos(angle),
    )
    still = replace(vehicle, spring_n_m=Rotors(1e-12, vehicle.spring_n_m.lower))
    state = flown(still, state, 0.5, throttle=None)
    x, y, z = state.bar_x, state.bar_y, state.bar_z
    assert math.acos(z) == pytest.approx(angle * math.exp(-0.5 / vehicle.bar_time_constant_s), rel=1e-3)
    assert x * 0.8 == pytest.approx(y * 0.6, abs=1e-6)


def test_ground_effect_adds_its_fraction_on_the_floor_and_decays() -> None:
    vehicle = HelicopterParameters.nominal()

    def thrust(z: float) -> float:
        return sum(rotor_thrusts(airframe_of(vehicle), *vehicle.hover_speeds_rad_s, z))

    factors = [thrust(z) / thrust(50.0) - 1 for z in (0.0, 0.1, 0.5)]
    assert factors == pytest.approx([0.075, 0.075 / math.e, 0.075 * math.exp(-5)])


def test_integrator_agrees_with_steps_ten_times_finer() -> None:
    vehicle = HelicopterParameters.nominal(0.6)
    swash, throttle = swash_target(vehicle, 0.7, -0.5), (0.6, 0.2)
    coarse = flown(vehicle, hovering(vehicle), 0.8, swash, throttle)
    fine = flown(vehicle, hovering(vehicle), 0.8, swash, throttle, STEP_S / 10)
    assert coarse[:3] == pytest.approx(fine[:3], abs=5e-4)
    assert mast(coarse) == pytest.approx(mast(fine), abs=2e-3)


@given(
    seed=st.integers(0, 10**6),
    sticks=st.lists(
        st.tuples(
            st.floats(-1, 1), st.floats(-1, 1), st.one_of(st.none(), st.floats(0, 1)), st.floats(-1, 1)
        ),
        min_size=1,
        max_size=15,
    ),
)
@settings(max_examples=25, deadline=None)
def test_no_sticks_make_the_state_infinite_or_the_energy_absurd(
    seed: int, sticks: list[tuple[float, float, float | None, float]]
) -> None:
    vehicle = HelicopterParameters.drawn(np.random.default_rng(seed))
    state = hovering(vehicle)
    for pitch, roll, thrust, yaw in sticks:
        throttle = None if thrust is None else (thrust, yaw)
        state = flown(vehicle, state, 0.2, swash_target(vehicle, pitch, roll), throttle)
        assert np.all(np.isfinite(state))
        assert np.linalg.norm(state[6:10]) == pytest.approx(1.0)
        assert np.linalg.norm(state[15:18]) == pytest.approx(1.0)
        assert np.abs(state[10:13]).max() < 100.0
        assert np.linalg.norm(state[3:6]) < 3.0 * 20.0
