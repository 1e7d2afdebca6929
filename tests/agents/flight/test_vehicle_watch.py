"""A vehicle that does not do what its sticks say is noticed; wind and manoeuvres are not it."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.flight.vehicle_watch import (
    LEARNING_S,
    THRUST_WINDOW_S,
    HoverThrustLimits,
    VehicleFault,
    VehicleWatch,
)
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.prediction import predict
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW, Array

HOVER = COAXIAL_LAG.hover_input
CALM = np.zeros(4)


class Flown:
    """A vehicle of the model, but for what is broken, and the watch over it."""

    def __init__(self, limits: HoverThrustLimits | None = None, period_s: float = 0.02) -> None:
        self.watch = VehicleWatch(COAXIAL_LAG, limits or HoverThrustLimits(), period_s)
        self.period_s = period_s
        self.time_s = 0.0
        self.gain = np.ones(4)
        self.wind = CALM.copy()
        self.state = Estimate(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), HOVER.copy(), CALM)
        self._late = HOVER

    def fly(self, seconds: float, stick: Array | Callable[[float], Array]) -> VehicleFault | None:
        """Fly with sticks; the first fault ends the flight."""
        for step in range(round(seconds / self.period_s)):
            command = stick(step * self.period_s) if callable(stick) else stick
            self.time_s += self.period_s
            fault = self.watch.observe(command, self.state.motion, self.time_s)
            if fault is not None:
                return fault
            pushed = Estimate(self.state.motion, self.state.actuator, self.wind)
            self.state = predict(COAXIAL_LAG, pushed, self.gain * self._late, self.period_s)
            self._late = command
        return None

    def holding(self, seconds: float) -> VehicleFault | None:
        """Fly with the thrust that carries the vehicle, and brake what is left of its climb."""

        def stick(_: float) -> Array:
            thrust = (9.81 - 3.0 * self.state.motion[6] - self.wind[2]) / (18.0 * self.gain[U_THRUST])
            return np.array([0.0, 0.0, min(max(thrust, 0.0), 1.0), 0.0])

        return self.fly(seconds, stick)


def held(axis: int, value: float) -> Array:
    stick = HOVER.copy()
    stick[axis] = value
    return stick


@pytest.mark.parametrize("period_s", [0.005, 0.01, 0.02, 0.04])
@pytest.mark.parametrize(
    ("axis", "name", "value"), [(U_PITCH, "pitch", 0.9), (U_ROLL, "roll", -0.9), (U_YAW, "yaw", 0.38)]
)
def test_an_axis_without_effect_and_a_reversed_one_are_told_apart(
    axis: int, name: str, value: float, period_s: float
) -> None:
    for gain, kind, text in (
        (0.0, "axis_dead", f"{name} has no effect"),
        (-1.0, "axis_reversed", f"{name} acts the wrong way round"),
    ):
        flown = Flown(period_s=period_s)
        assert flown.holding(2.0) is None
        flown.gain[axis] = gain
        assert flown.fly(1.5, held(axis, value)) == VehicleFault(kind, text, (axis,))


sticks = st.floats(-1.0, 1.0)


@given(
    st.lists(st.tuples(sticks, sticks, sticks), min_size=4, max_size=4),
    st.floats(0.6, 1.7),
    st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)),
)
@settings(max_examples=40, deadline=None)
def test_sound_axes_are_left_alone_in_any_manoeuvre_and_wind(
    manoeuvre: list[tuple[float, float, float]], gain: float, wind: tuple[float, float]
) -> None:
    flown = Flown()
    flown.gain[[U_PITCH, U_ROLL, U_YAW]] = gain
    flown.wind[:2] = wind

    def stick(time_s: float) -> Array:
        pitch, roll, yaw = manoeuvre[min(int(time_s / 0.7), len(manoeuvre) - 1)]
        return np.array([pitch, roll, HOVER[U_THRUST], 0.4 * yaw])

    assert flown.fly(2.8, stick) is None


@pytest.mark.parametrize("frequency_hz", [1.0, 2.0, 3.0, 5.0])
def test_a_vehicle_that_oscillates_is_not_broken(frequency_hz: float) -> None:
    """It responds so late that the response is opposite to the present stick."""
    flown = Flown()
    flown.gain[:2] = -1.0

    def stick(time_s: float) -> Array:
        return held(U_PITCH, float(np.clip(3.0 * np.sin(2 * np.pi * frequency_hz * time_s), -1.0, 1.0)))

    assert flown.fly(4.0, stick) is None


@pytest.mark.parametrize("left", [0.65, 0.5])
def test_a_rotor_that_becomes_weak_is_noticed_within_two_seconds(left: float) -> None:
    flown = Flown()
    assert flown.holding(LEARNING_S + 1.5) is None
    flown.gain[U_THRUST] = left
    fault = flown.holding(2.0)
    assert fault is not None
    assert (fault.kind, fault.axes) == ("thrust_lost", ())


@pytest.mark.parametrize("left", [1.2, 0.8])
def test_a_battery_and_a_draught_from_above_are_no_weak_rotor(left: float) -> None:
    flown = Flown()
    assert flown.holding(LEARNING_S + 1.5) is None
    flown.gain[U_THRUST] = left
    flown.wind[2] = -0.5
    assert flown.holding(4.0) is None


def test_full_thrust_that_does_not_lift_is_noticed_after_a_second() -> None:
    flown = Flown()
    flown.gain[U_THRUST] = 0.5
    fault = flown.fly(3.0, held(U_THRUST, 1.0))
    assert fault is not None
    assert fault.kind == "thrust_exhausted"


def test_full_thrust_that_lifts_is_none_of_its_business() -> None:
    assert Flown().fly(THRUST_WINDOW_S + 1.0, held(U_THRUST, 1.0)) is None


def test_an_ageing_battery_is_warned_of_and_then_lands() -> None:
    flown = Flown(HoverThrustLimits(0.65, 0.75))
    assert flown.holding(LEARNING_S + 1.5) is None
    assert not flown.watch.remark
    flown.gain[U_THRUST] = HOVER[U_THRUST] / 0.7
    assert flown.holding(12.0) is None
    assert "hovers at 0.6" in flown.watch.remark or "hovers at 0.70" in flown.watch.remark
    flown.gain[U_THRUST] = HOVER[U_THRUST] / 0.77
    fault = flown.holding(30.0)
    assert fault is not None
    assert fault.kind == "battery_empty"
    assert flown.watch.hover_thrust == pytest.approx(0.75, abs=0.01)


def test_a_battery_that_empties_slowly_is_warned_of_before_it_lands_and_is_no_weak_rotor() -> None:
    flown = Flown()
    assert flown.holding(LEARNING_S + 1.5) is None
    warned_at, fault = None, None
    for percent in range(100, 50, -1):
        flown.gain[U_THRUST] = percent / 100
        fault = flown.holding(3.0)
        warned_at = warned_at or (percent if flown.watch.remark else None)
        if fault is not None:
            break
    assert fault is not None
    assert fault.kind == "battery_empty"
    assert warned_at is not None
    assert warned_at > percent
    # What is left still carries the vehicle.
    assert HOVER[U_THRUST] / flown.gain[U_THRUST] < 0.92


def test_another_flight_begins_with_another_battery() -> None:
    flown = Flown(HoverThrustLimits(0.6, 0.95))
    flown.gain[U_THRUST] = HOVER[U_THRUST] / 0.8
    flown.holding(6.0)
    assert flown.watch.remark
    flown.watch.begin()
    assert not flown.watch.remark


def test_a_gap_in_what_is_known_of_the_motion_begins_new_windows() -> None:
    flown = Flown()
    flown.gain[U_PITCH] = 0.0
    for _ in range(5):
        assert flown.fly(0.5, held(U_PITCH, 0.9)) is None
        flown.watch.observe(HOVER, flown.state.motion, flown.time_s, informative=False)


@pytest.mark.parametrize(("warn_at", "land_at"), [(0.9, 0.8), (0.0, 0.8), (0.8, 1.1)])
def test_limits_out_of_order_are_refused(warn_at: float, land_at: float) -> None:
    with pytest.raises(ValueError, match="must be in order"):
        HoverThrustLimits(warn_at, land_at)
