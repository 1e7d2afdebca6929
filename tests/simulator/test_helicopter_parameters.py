"""Promises of the family of helicopters."""

from typing import Any

import numpy as np

from rcopterx.simulator.helicopter_parameters import HelicopterParameters

COAXES = [HelicopterParameters.drawn_coax(np.random.default_rng(seed)) for seed in range(300)]
DRAWN = [HelicopterParameters.drawn(np.random.default_rng(seed)) for seed in range(300)]


def test_same_generator_draws_the_same_vehicle() -> None:
    again, other = (HelicopterParameters.drawn(np.random.default_rng(seed)) for seed in (7, 8))
    assert again == DRAWN[7]
    assert other != again


def test_family_lies_within_its_stated_ranges_and_fills_them() -> None:
    def column(name: str) -> Any:
        return np.array([getattr(vehicle, name) for vehicle in DRAWN])

    for name, low, high in (
        ("size", 0.6, 1.0),
        ("added_damping", 0.1, 0.5),
        ("servo_lag_s", 0.02, 0.04),
        ("ground_effect", 0.05, 0.1),
        ("thrust_gain_m_s2", 16.2, 19.8),
    ):
        values = column(name)
        assert low <= values.min() <= low + 0.05 * (high - low), name
        assert high - 0.05 * (high - low) <= values.max() <= high, name
    assert np.abs(column("trim")).max() <= 0.03
    tilt = np.degrees(np.hypot(column("marker_roll_rad"), column("marker_pitch_rad")))
    assert 4.5 < tilt.max() <= 5.0


def test_fast_modes_and_plateaus_of_the_family_are_those_that_controllers_must_cope_with() -> None:
    modes = np.array([vehicle.fast_mode_rad_s for vehicle in DRAWN])
    assert 8.9 < modes.min() < 10.5
    assert 15.5 < modes.max() < 18.5
    plateaus = np.array([vehicle.plateau_per_swash.real * vehicle.swash_gain_rad[0] for vehicle in DRAWN])
    assert 1.7 <= plateaus.min() < 1.75
    assert 2.25 < plateaus.max() <= 2.3
    coupling = np.degrees([abs(np.angle(vehicle.plateau_per_swash)) for vehicle in DRAWN])
    assert 2.0 < coupling.min() < coupling.max() < 20.0


def test_neighbours_of_the_real_vehicle_lie_within_their_stated_ranges_and_fill_them() -> None:
    turns = np.degrees([[axis - one.hover_phases_rad.lower for axis in one.servo_axes_rad] for one in COAXES])
    for name, values, low, high in (
        ("mode", [one.fast_mode_rad_s for one in COAXES], 9.0, 10.5),
        ("damping", [one.added_damping for one in COAXES], 0.3, 0.5),
        ("delay", [one.delay_s for one in COAXES], 0.01, 0.06),
        ("flapping", [one.flapping_rad_s_m for one in COAXES], 6.2, 10.4),
        ("its phase", np.degrees([one.flapping_phase_rad for one in COAXES]), -52.0, -32.0),
        ("turn of the pitch servo", turns[:, 0], -40.0, -15.0),
        ("turn of the roll servo", turns[:, 1], -40.0, -15.0),
    ):
        assert low - 1e-6 <= np.min(values) <= low + 0.05 * (high - low), name
        assert high - 0.05 * (high - low) <= np.max(values) <= high + 1e-6, name
    assert {one.size for one in COAXES} == {1.0}
