"""Promises of the register of estimators."""

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control import plugins
from rcopterx.control.estimators.extended_kalman import ExtendedKalmanEstimator
from rcopterx.control.plugins import ESTIMATORS


def test_built_in_estimators_are_listed_and_the_default_is_among_them() -> None:
    assert "extended_kalman" in ESTIMATORS.available()
    assert isinstance(ESTIMATORS.build("extended_kalman", COAXIAL_LAG, 0.02, {}), ExtendedKalmanEstimator)


def test_unknown_estimator_is_refused_with_the_allowed_ones() -> None:
    with pytest.raises(
        ValueError, match=r"'luenberger'; allowed are extended_kalman, finite_difference, kal"
    ):
        ESTIMATORS.build("luenberger", COAXIAL_LAG, 0.02, {})


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("kalman", {"cutoff_hz": 3.0}, r"'kalman': unknown setting 'cutoff_hz'; allowed are .*jerk_noise"),
        ("kalman", {"yaw_noise_rad": "low"}, r"Expected `float`, got `str` .*yaw_noise_rad"),
        ("kalman", {"yaw_noise_rad": 0.0}, r"> 0.0 .*yaw_noise_rad"),
        ("kalman", {"yaw_noise_rad": float("nan")}, r"yaw_noise_rad: every number must be finite"),
        ("extended_kalman", {"disturbance_noise": [0.1, 0.1]}, r"length 4.*disturbance_noise"),
        ("extended_kalman", {"velocity_noise": [0.1, 0.1, 0.1, float("inf")]}, r"velocity_noise: .* finite"),
        ("finite_difference", {"cutoff_hz": 40.0}, r"cutoff_hz: 40.0 is above half the pose rate, 25 Hz"),
    ],
)
def test_wrong_settings_are_refused_by_name(name: str, settings: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ESTIMATORS.build(name, COAXIAL_LAG, 0.02, settings)


@pytest.mark.parametrize("period_s", [0.0, -0.02, 1.0, float("nan")])
def test_period_out_of_range_is_refused(period_s: float) -> None:
    with pytest.raises(ValueError, match=r"period_s must be from 0\.002 to 0\.2 s"):
        ESTIMATORS.build("kalman", COAXIAL_LAG, period_s, {})


def test_installed_package_can_add_an_estimator(monkeypatch: pytest.MonkeyPatch) -> None:
    added = EntryPoint(
        "mine", "rcopterx_studies.baselines.kalman:KalmanEstimator", ESTIMATORS.entry_point_group
    )
    broken = EntryPoint("broken", "no_such_package:Estimator", ESTIMATORS.entry_point_group)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [added, broken])
    assert {"mine", "broken"} <= set(ESTIMATORS.available())
    assert type(ESTIMATORS.build("mine", COAXIAL_LAG, 0.02, {})).__name__ == "KalmanEstimator"
    with pytest.raises(ValueError, match=r"'broken' .* cannot be imported"):
        ESTIMATORS.build("broken", COAXIAL_LAG, 0.02, {})


def test_listing_estimators_imports_none_of_them() -> None:
    code = (
        "import sys; from rcopterx.control.plugins import ESTIMATORS; ESTIMATORS.available();"
        "sys.exit(any(m in sys.modules for m in "
        "('rcopterx_studies.baselines.kalman', 'rcopterx.control.estimators.extended_kalman')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
