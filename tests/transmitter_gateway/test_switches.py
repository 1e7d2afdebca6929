"""Promises of the arming and the emergency channel, for every sequence of states and times."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.calibration import (
    ArmingChannel,
    Calibration,
    SwitchChannel,
    ThrottleCalibration,
)
from rcopterx.radios.crazyflie import CrazyflieProtocol
from rcopterx.radios.dsm2_serial import Dsm2SerialProtocol
from rcopterx.radios.dsmp import DsmpProtocol, DsmpSettings
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.radios.ppm import PpmGenProtocol, PpmSettings
from rcopterx.radios.protocol import PulseRangeError, RadioProtocol
from rcopterx.transmitter_gateway.inputs import FLYING, NEUTRAL, ArbiterOutput, State
from rcopterx.transmitter_gateway.switches import Arming, channels_of, prepare_channels

LOW_S = 0.1
ARMING, EMERGENCY, THROTTLE = ArmingChannel(4, 1900, 1100, low_s=LOW_S), SwitchChannel(5, 2000, 1000), 0
SWITCHED = Calibration(arming=ARMING, emergency=EMERGENCY)
DISARMED = ArbiterOutput(State.DISARMED)


def output(state: State, thrust: float) -> ArbiterOutput:
    return ArbiterOutput(state, (0.1, 0.0, thrust, 0.0) if state in FLYING else NEUTRAL)


frames = st.lists(
    st.tuples(st.sampled_from(State), st.floats(0.0, 1.0), st.sampled_from((0.004, 0.02, 0.06, 0.15))),
    min_size=1,
    max_size=60,
)


def flown(sequence: list[tuple[State, float, float]]) -> list[tuple[float, State, tuple[float, ...]]]:
    """Time, state and pulse widths of the frames of a process that began disarmed."""
    now_s = 0.0
    pulses, arming = channels_of(SWITCHED, DISARMED, None, now_s)
    written = [(now_s, State.DISARMED, pulses)]
    for state, thrust, pause_s in sequence:
        now_s += pause_s
        pulses, arming = channels_of(SWITCHED, output(state, thrust), arming, now_s)
        written.append((now_s, state, pulses))
    return written


@given(frames)
def test_the_vehicle_is_armed_only_in_flying_states(sequence: list[tuple[State, float, float]]) -> None:
    for _, state, pulses in flown(sequence):
        assert state in FLYING or not ARMING.is_on(pulses)
        assert state in FLYING or pulses[THROTTLE] == SWITCHED.throttle.low_us


@given(frames)
def test_the_throttle_is_low_for_its_time_before_and_after_the_switch(
    sequence: list[tuple[State, float, float]],
) -> None:
    written = flown(sequence)
    for at, (now_s, _, pulses) in enumerate(written):
        if not ARMING.is_on(pulses) or ARMING.is_on(written[at - 1][2]):
            continue
        before = [row for row in written[:at] if now_s - row[0] <= LOW_S + 1e-9]
        assert all(row[2][THROTTLE] == SWITCHED.throttle.low_us for row in before)
        assert not any(ARMING.is_on(row[2]) for row in before)
        after = [row for row in written[at:] if row[0] - now_s < LOW_S - 1e-9]
        assert all(row[2][THROTTLE] == SWITCHED.throttle.low_us for row in after)


@given(frames)
def test_an_armed_vehicle_stays_armed_until_its_flight_is_over(
    sequence: list[tuple[State, float, float]],
) -> None:
    written = flown(sequence)
    for (_, _, before), (_, state, after) in pairwise(written):
        if ARMING.is_on(before):
            assert ARMING.is_on(after) == (state in FLYING)


@given(frames)
def test_a_kill_releases_the_arming_channel_and_stops_in_the_same_frame(
    sequence: list[tuple[State, float, float]],
) -> None:
    for _, state, pulses in flown(sequence):
        assert EMERGENCY.is_on(pulses) == (state is State.KILLED)
        if state is State.KILLED:
            assert not ARMING.is_on(pulses)


@given(st.sampled_from(sorted(FLYING)), st.floats(0.0, 1.0))
def test_a_vehicle_of_an_earlier_process_stays_armed_with_its_thrust(state: State, thrust: float) -> None:
    pulses, _ = channels_of(SWITCHED, output(state, thrust), None, 5.0)
    assert ARMING.is_on(pulses)
    assert pulses[THROTTLE] == SWITCHED.throttle.pulse_us(thrust)


@given(frames)
def test_without_an_arming_channel_the_arbiter_alone_decides(
    sequence: list[tuple[State, float, float]],
) -> None:
    arming: Arming | None = None
    for number, (state, thrust, _) in enumerate(sequence):
        shaped = output(state, thrust)
        pulses, arming = channels_of(Calibration(), shaped, arming, 0.02 * number)
        assert pulses == Calibration().pulses_us(shaped.u, throttle_low=state not in FLYING)


def armed_and_raised(*states: State, pause_s: float = 0.0625) -> list[tuple[bool, bool]]:
    """Whether the arming channel is on and the throttle raised in frames of a process that began disarmed."""
    calibration = replace(SWITCHED, arming=replace(ARMING, low_s=0.125))
    pulses, arming = channels_of(calibration, DISARMED, None, 0.0)
    found = []
    for number, state in enumerate(states, start=1):
        pulses, arming = channels_of(calibration, output(state, 0.5), arming, number * pause_s)
        found.append((ARMING.is_on(pulses), pulses[THROTTLE] > calibration.throttle.low_us))
    return found


def test_a_flight_begins_with_the_switch_off_then_on_then_with_thrust() -> None:
    off, on, raised = (False, False), (True, False), (True, True)
    assert armed_and_raised(*5 * (State.ARMED,)) == [off, on, on, raised, raised]


def test_a_vehicle_that_was_disarmed_for_long_is_armed_at_once() -> None:
    assert armed_and_raised(*6 * (State.DISARMED,), State.ARMED)[-2:] == [(False, False), (True, False)]


def test_the_switch_rests_between_two_flights() -> None:
    flights = (*4 * (State.ARMED,), State.CUT, *5 * (State.ARMED,))
    off, on, raised = (False, False), (True, False), (True, True)
    assert armed_and_raised(*flights)[3:] == [raised, off, off, on, on, raised, raised]


@pytest.mark.parametrize(
    "calibration",
    [
        replace(SWITCHED, arming=replace(ARMING, on_us=2100.0)),
        replace(SWITCHED, arming=replace(ARMING, off_us=900.0)),
        replace(SWITCHED, emergency=replace(EMERGENCY, on_us=2100.0)),
        replace(SWITCHED, emergency=replace(EMERGENCY, off_us=900.0)),
        replace(SWITCHED, throttle=ThrottleCalibration(low_us=900.0)),
        replace(SWITCHED, pitch=replace(SWITCHED.pitch, gain_us=600.0, lo_us=900.0)),
        replace(SWITCHED, pitch=replace(SWITCHED.pitch, gain_us=600.0, hi_us=2100.0)),
    ],
    ids=["armed", "not armed", "stopped", "not stopped", "throttle low", "pitch back", "pitch forward"],
)
def test_a_position_that_the_radio_cannot_carry_is_refused(calibration: Calibration) -> None:
    with pytest.raises(PulseRangeError):
        prepare_channels(MultiProtocol(), calibration, ArbiterLimits())


def test_the_radio_lets_further_channels_rest_where_the_calibration_puts_them() -> None:
    protocol = MultiProtocol()
    prepare_channels(protocol, replace(SWITCHED, rest_us=1250.0), ArbiterLimits())
    assert protocol.rest_us == 1250.0


def test_other_channels_rest_where_the_type_puts_them() -> None:
    calibration = Calibration(emergency=SwitchChannel(6), rest_us=1000.0)
    pulses, _ = channels_of(calibration, DISARMED, None, 0.0)
    assert pulses[4:] == (1000.0, 1000.0, 1100.0)


@pytest.mark.parametrize(
    ("protocol", "sent"),
    [
        (MultiProtocol(), 6),
        (MultiProtocol(MultiSettings(channels=4)), 4),
        (MultiProtocol(MultiSettings(radio="CFlie")), 4),
        (MultiProtocol(MultiSettings(radio="OMP", channels=12)), 7),
        (PpmGenProtocol(PpmSettings(channels=4)), 4),
        (DsmpProtocol(DsmpSettings(channels=4)), 4),
        (Dsm2SerialProtocol(), 6),
        (CrazyflieProtocol(), 6),
    ],
)
def test_a_switch_on_a_channel_that_is_not_sent_is_refused(protocol: RadioProtocol, sent: int) -> None:
    prepare_channels(protocol, Calibration(), ArbiterLimits())
    if sent > 4:
        prepare_channels(protocol, Calibration(arming=ArmingChannel(sent - 1)), ArbiterLimits())
    with pytest.raises(PulseRangeError, match=rf"channel {sent}, but only channels 0 to {sent - 1} are sent"):
        prepare_channels(protocol, Calibration(emergency=SwitchChannel(sent)), ArbiterLimits())
