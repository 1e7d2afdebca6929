import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.calibration import (
    Calibration,
    CalibrationError,
    ChannelCalibration,
    ThrottleCalibration,
)

inputs = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1), st.floats(-0.4, 0.4))


def test_example_of_the_specification_becomes_its_pulse_widths() -> None:
    assert Calibration().pulses_us((0.5, -0.25, 0.6, 0.1)) == (1580, 1400, 1700, 1540)


@pytest.mark.parametrize(("u_z", "pulse"), [(0, 1100), (0.275, 1320), (0.55, 1540), (0.775, 1720), (1, 1900)])
def test_throttle_is_linear_between_its_three_points(u_z: float, pulse: float) -> None:
    assert math.isclose(ThrottleCalibration().pulse_us(u_z), pulse)


@pytest.mark.parametrize(("u_z", "pulse"), [(-0.5, 1100), (1.5, 1900)])
def test_throttle_stays_within_its_end_points(u_z: float, pulse: float) -> None:
    assert ThrottleCalibration().pulse_us(u_z) == pulse


def test_full_yaw_input_is_160_us() -> None:
    assert math.isclose(Calibration().pulses_us((0, 0, 0, 0.4))[3], 1660)


def test_sign_trim_and_limits_apply() -> None:
    channel = ChannelCalibration(2, sign=-1, trim_us=20, gain_us=500, lo_us=1150, hi_us=1850)
    assert channel.pulse_us(0) == 1520
    assert channel.pulse_us(0.5) == 1270
    assert channel.pulse_us(1) == 1150
    assert channel.pulse_us(-1) == 1850


def test_throttle_low_is_free_of_the_trim_in_us0() -> None:
    calibration = Calibration(throttle=ThrottleCalibration(us0=1180, low_us=1100))
    assert calibration.pulses_us((0, 0, 0, 0))[0] == 1180
    assert calibration.pulses_us((0, 0, 0.8, 0), throttle_low=True)[0] == 1100


@given(inputs, st.sampled_from([1, -1]), st.floats(-50, 50), st.floats(100, 300))
def test_vehicle_sees_the_inputs_that_were_sent(
    u: tuple[float, float, float, float], sign: int, trim: float, gain: float
) -> None:
    calibration = Calibration(
        pitch=ChannelCalibration(1, sign=sign, trim_us=trim, gain_us=gain),
        roll=ChannelCalibration(2, gain_us=gain),
        throttle=ThrottleCalibration(us0=1150, us_hover=1480),
        yaw=ChannelCalibration(7, sign=-sign),
    )
    for sent, seen in zip(u, calibration.inputs(calibration.pulses_us(u)), strict=True):
        assert math.isclose(sent, seen, abs_tol=1e-9)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.sampled_from([1, -1]))
def test_after_trimming_the_mean_input_of_the_hover_is_neutral(
    pitch: float, roll: float, yaw: float, sign: int
) -> None:
    before = Calibration(pitch=ChannelCalibration(2, sign=sign, trim_us=-15))
    after = before.trimmed((pitch, roll, 0.55, yaw))
    wanted = before.pulses_us((pitch, roll, 0.55, yaw))
    assert all(math.isclose(a, b) for a, b in zip(after.pulses_us((0, 0, 0.55, 0)), wanted, strict=True))
    assert math.isclose(after.pitch.trim_us, -15 + sign * 400 * pitch, abs_tol=1e-9)
    assert after.throttle == before.throttle


def test_trim_beyond_the_limits_is_refused_with_the_field() -> None:
    with pytest.raises(CalibrationError, match=r"roll\.trim_us: 440"):
        Calibration().trimmed((0, 1.1, 0.55, 0))


@given(st.lists(st.floats(800, 2200), min_size=3, max_size=3, unique=True).map(sorted))
def test_throttle_inverse_never_leaves_the_input_range(points: list[float]) -> None:
    us0, us_hover, us1 = points
    throttle = ThrottleCalibration(us0=us0, us_hover=us_hover, us1=us1, low_us=us0)
    for pulse in (800.0, us0, us_hover, us1, 2200.0):
        assert 0 <= throttle.stick_input(pulse) <= 1


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"index": 16}, "index"),
        ({"index": -1}, "index"),
        ({"sign": 0}, "sign"),
        ({"center_us": math.nan}, "center_us"),
        ({"gain_us": 0}, "gain_us"),
        ({"gain_us": math.inf}, "gain_us"),
        ({"lo_us": 700}, "lo_us"),
        ({"hi_us": 2300}, "hi_us"),
        ({"lo_us": 1900}, "lo_us"),
        ({"trim_us": 500}, "trim_us"),
        ({"trim_us": math.nan}, "trim_us"),
        ({"slew_per_s": 0}, "slew_per_s"),
    ],
)
def test_wrong_channel_values_name_the_field(change: dict[str, float], field: str) -> None:
    with pytest.raises(CalibrationError, match=f"^{field}: "):
        ChannelCalibration(**{"index": 2, **change})


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"us_hover": 1000}, "us_hover"),
        ({"us1": 1500}, "us_hover"),
        ({"us0": math.inf}, "us0"),
        ({"u_hover": 0}, "u_hover"),
        ({"u_hover": 1}, "u_hover"),
        ({"low_us": 1101}, "low_us"),
        ({"slew_per_s": -1}, "slew_per_s"),
    ],
)
def test_wrong_throttle_values_name_the_field(change: dict[str, float], field: str) -> None:
    with pytest.raises(CalibrationError, match=f"^{field}: "):
        ThrottleCalibration(**change)


def test_two_inputs_on_one_channel_are_refused() -> None:
    with pytest.raises(CalibrationError, match=r"roll\.index: channel 2 is already used by pitch"):
        Calibration(roll=ChannelCalibration(2))


def test_slew_rates_are_in_the_order_of_the_inputs() -> None:
    assert Calibration().slew_per_s == (20, 20, 4, 8)
