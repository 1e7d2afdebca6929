"""A transmitter at the workbench: binding, range check, shown inputs, calibrations that are refused."""

from collections.abc import Callable
from dataclasses import replace
from operator import call
from pathlib import Path

import pytest
from transmitter_bench import IDLE, LINE, Bench, settings_of

from rcopterx.radios.calibration import (
    ArmingChannel,
    Calibration,
    ChannelCalibration,
    ThrottleCalibration,
)
from rcopterx.radios.dsm2_serial import Dsm2SerialProtocol
from rcopterx.radios.multi import MultiProtocol
from rcopterx.radios.ppm import PpmGenProtocol
from rcopterx.radios.protocol import ProtocolError, PulseRangeError, RadioProtocol
from rcopterx.transmitter_gateway.inputs import Action, Answer, LinkState
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.transmitter import Transmitter


def test_binding_ends_when_the_module_is_done_and_settles_for_5_s(bench: Bench) -> None:
    receiver = bench.radio.link.receiver
    receiver.enter_bind_mode()
    bench.run(1.5, IDLE)
    assert bench.transmitter.bind(bench.now_s).accepted
    started_s = bench.now_s
    bench.run(0.2, IDLE)
    assert bench.frames[-1].bind
    while bench.frames[-1].bind:
        bench.run(0.1, IDLE)
        assert bench.now_s < started_s + 7.5
    assert bench.now_s - started_s == pytest.approx(6.03, abs=0.6)
    assert receiver.model_match == 3
    assert bench.transmitter.link(bench.now_s).state is LinkState.UP
    assert not bench.request(Action.ARM).accepted
    bench.run(0.1, IDLE)
    assert not bench.frames[-1].bind
    bench.run(5.2, IDLE)
    assert bench.request(Action.ARM).accepted


def test_bind_is_given_up_after_7_s_when_the_module_never_says_it_is_done(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    bench.transmitter.bind(bench.now_s)
    bench.port.read_available = lambda now_s: b""  # type: ignore[method-assign]  # its answers stop
    bench.run(6.9, IDLE)
    assert bench.frames[-1].bind
    bench.run(0.2, IDLE)
    assert not bench.frames[-1].bind


def test_binding_and_range_check_are_refused_in_flight_and_without_a_port(bench: Bench) -> None:
    bench.fly()
    transmitter = bench.transmitter
    for what, refused in (
        ("binding", transmitter.bind(bench.now_s)),
        ("range check", transmitter.range_check(True)),
        ("calibration", transmitter.show(IDLE)),
    ):
        assert refused == Answer(False, f"{what} is only possible while DISARMED, not ARMED")
    assert not transmitter.busy(bench.now_s)
    bench.radio.unplug()
    bench.run(0.75)
    assert transmitter.bind(bench.now_s) == Answer(False, f"binding is not possible: {bench.port.problem}")


def test_what_is_requested_at_the_workbench_is_written_at_once(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    for request, answer in (
        (lambda: bench.transmitter.range_check(True), Answer(True, "range check on")),
        (lambda: bench.transmitter.range_check(False), Answer(True, "range check off")),
        (lambda: bench.transmitter.show(IDLE), Answer(True, "shown")),
        (lambda: bench.transmitter.bind(bench.now_s), Answer(True, "binding")),
    ):
        bench.run(1.0, None)
        last_s = bench.writes[-1].time_s
        while bench.writes[-1].time_s == last_s:
            bench.run(0.001, None)
        # A frame has just been written; the next one waits for the receiver only, not for the keep-alive.
        written = len(bench.writes)
        assert request() == answer
        bench.run(0.0075, None)
        assert len(bench.writes) == written + 1


def test_inputs_are_shown_with_low_throttle_until_their_time_or_the_end_is_requested(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    throttle, pitch = 0, 2
    centre_us = bench.writes[-1].pulses_us[pitch]
    assert bench.transmitter.show((0.5, 0.0, 0.9, 0.0), until_s=bench.now_s + 0.5).accepted
    bench.run(0.4, IDLE)
    assert abs(bench.writes[-1].pulses_us[pitch] - centre_us) > 100
    assert bench.writes[-1].pulses_us[throttle] == 1100
    assert bench.request(Action.ARM).reason == "missing: transmitter ready"
    bench.run(0.2, None)
    assert bench.writes[-1].pulses_us[pitch] == centre_us
    assert bench.transmitter.show((0.5, 0.0, 0.0, 0.0)).accepted
    bench.run(10.0, None)
    assert abs(bench.writes[-1].pulses_us[pitch] - centre_us) > 100
    assert bench.transmitter.show(None).accepted
    bench.run(0.1, IDLE)
    assert bench.writes[-1].pulses_us[pitch] == centre_us
    assert not bench.transmitter.busy(bench.now_s)


def test_a_throttle_within_the_calibration_is_shown_with_the_arming_channel_on(tmp_path: Path) -> None:
    arming = ArmingChannel(4)
    calibration = Calibration(throttle=ThrottleCalibration(us0=1150, us1=1900), arming=arming)
    bench = Bench(tmp_path / "h1", calibration)
    try:
        bench.run(1.0, None)
        for throttle_us in (1100.0, 1500.0, 1900.0):
            assert bench.transmitter.show(IDLE, throttle_us=throttle_us).accepted
            bench.run(0.1, None)
            assert bench.writes[-1].pulses_us[0] == throttle_us
            assert arming.is_on(bench.writes[-1].pulses_us)
        for throttle_us in (1099.0, 1901.0):
            refused = bench.transmitter.show(IDLE, throttle_us=throttle_us)
            assert refused == Answer(False, f"throttle {throttle_us:g} us is outside 1100 .. 1900")
        assert bench.transmitter.show(IDLE).accepted
        bench.run(0.1, None)
        assert not arming.is_on(bench.writes[-1].pulses_us)
    finally:
        bench.close()


def test_range_check_reduces_the_power_and_forbids_arming(bench: Bench) -> None:
    bench.run(1.5, IDLE)
    assert bench.transmitter.range_check(True).reason == "range check on"
    bench.run(0.1, IDLE)
    bench.radio.link.receiver.in_range_check_reach = False
    bench.run(2.0, IDLE)
    assert bench.radio.link.receiver.state(bench.now_s) == "failsafe"
    assert bench.request(Action.ARM).reason == "missing: transmitter ready"
    bench.transmitter.range_check(False)
    bench.run(0.1, IDLE)
    assert bench.radio.link.receiver.state(bench.now_s) == "linked"
    assert bench.request(Action.ARM).accepted


def make(
    protocol: RadioProtocol, *, calibration: Calibration | None = None, low_power: bool = False
) -> Transmitter:
    settings = settings_of(calibration or Calibration(), protocol)
    return Transmitter(replace(settings, low_power=low_power), SerialPort("/nonexistent", LINE, call))


@pytest.mark.parametrize(
    "build",
    [
        lambda: make(MultiProtocol(), calibration=Calibration(throttle=ThrottleCalibration(us1=2050))),
        lambda: make(
            MultiProtocol(), calibration=Calibration(roll=ChannelCalibration(1, gain_us=600, lo_us=900))
        ),
        lambda: make(Dsm2SerialProtocol(), calibration=Calibration(roll=ChannelCalibration(6))),
    ],
    ids=["throttle", "roll", "channel"],
)
def test_a_calibration_the_radio_cannot_carry_is_refused_at_the_start(
    build: Callable[[], Transmitter],
) -> None:
    with pytest.raises(PulseRangeError):
        build()


def test_wishes_the_radio_does_not_offer_are_refused() -> None:
    with pytest.raises(ProtocolError, match="low_power"):
        make(PpmGenProtocol(), low_power=True)
    transmitter = make(PpmGenProtocol())
    assert transmitter.range_check(True) == Answer(False, "ppm: check the range with the radio itself")
    assert transmitter.bind(0.0) == Answer(False, "ppm: bind with the radio itself")
