import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.dsmp import DsmpProtocol, DsmpSettings
from rcopterx.radios.protocol import (
    ForbiddenInFlightError,
    FrameDecodeError,
    FrameFlags,
    ProtocolError,
    PulseRangeError,
)

# Frames of EdgeTX, `pulses/dsmp.cpp`
SETUP = bytes.fromhex("AA 00 00 07 06 00")
BIND = bytes.fromhex("AA 00 C0 07 06 00")
THROTTLE_LOW = bytes.fromhex("AA 01 00 A9 06 00 0A 00 0E 00 12 00 16 00 FF FF")
VERSION_2 = bytes((0xAA, 0xFF, 0, 0, 0, 0, 2, 1)) + bytes(10)
BIND_RESULT = bytes((0xAA, 0x80, 0x00, 0x00, 0x06, 0x01)) + bytes(6)


def started(settings: DsmpSettings | None = None) -> DsmpProtocol:
    protocol = DsmpProtocol(settings)
    protocol.link_opened(0.0)
    return protocol


def test_first_frames_are_the_golden_set_up_and_throttle_low() -> None:
    protocol = started()
    assert protocol.encode([1100]) == SETUP
    assert protocol.encode([1100]) == THROTTLE_LOW


def test_bind_alternates_the_golden_bind_frame_with_channels() -> None:
    protocol = started()
    flags = FrameFlags(bind=True)
    frames = [protocol.encode([1100], flags, disarmed=True) for _ in range(4)]
    assert frames == [BIND, THROTTLE_LOW, BIND, THROTTLE_LOW]
    assert protocol.status(2.0).binding
    assert not protocol.status(2.0).ready
    protocol.receive(BIND_RESULT, 2.1)
    assert not protocol.status(2.2).binding
    assert protocol.encode([1100], FrameFlags()) == SETUP


@pytest.mark.parametrize("noise", [bytes(10), b"\xff" * 10, b"\x00\x00\x06\x37" + bytes(6)])
def test_noise_after_the_start_of_a_bind_result_ends_no_bind(noise: bytes) -> None:
    protocol = started()
    protocol.encode([1100], FrameFlags(bind=True), disarmed=True)
    protocol.receive(BIND_RESULT[:2] + noise, 0.1)
    assert protocol.status(2.0).binding
    protocol.receive(BIND_RESULT, 2.1)
    assert not protocol.status(2.2).binding


def test_golden_channel_frame_decodes() -> None:
    decoded = DsmpProtocol().decode(THROTTLE_LOW)
    assert math.isclose(decoded.pulses_us[0], 1100, abs_tol=1)
    assert decoded.pulses_us[1:] == (1500.0,) * 5


def test_set_up_comes_every_2_frames_50_times_then_every_100() -> None:
    protocol = started()
    kinds = [protocol.encode([1100])[1] for _ in range(50 * 3 + 300)]
    setups = [index for index, kind in enumerate(kinds) if kind == 0]
    assert setups[:50] == [3 * n for n in range(50)]
    assert [b - a for a, b in pairwise(setups[49:])] == [101] * (len(setups) - 50)


def test_firmware_2_is_faster_and_needs_fewer_set_ups() -> None:
    protocol = started()
    protocol.receive(VERSION_2[:5], 0.1)
    protocol.receive(VERSION_2[5:] + VERSION_2, 0.2)
    assert protocol.keepalive_s == 0.011
    assert protocol.status(2.0).text == "module 2.1"
    kinds = [protocol.encode([1100])[1] for _ in range(150)]
    assert kinds.count(0) == 2
    protocol.link_opened(3.0)
    assert protocol.keepalive_s == 0.02206


def test_range_check_sends_a_set_up_with_low_power_at_once() -> None:
    protocol = started()
    protocol.encode([1100])
    assert protocol.encode([1100], FrameFlags(range_check=True)) == bytes.fromhex("AA 00 00 04 06 00")


def test_mode_flags_are_those_of_the_settings() -> None:
    settings = DsmpSettings(model=9, channels=7, dsmx=True, eleven_ms=True, eleven_bit=True)
    assert started(settings).encode([1100]) == bytes.fromhex("AA 00 07 07 07 09")


def test_more_than_seven_channels_alternate_between_two_passes() -> None:
    protocol = started(DsmpSettings(channels=9))
    protocol.receive(2 * VERSION_2, 0.0)
    frames = [protocol.encode([1100, *([1500] * 7), 1900]) for _ in range(5)]
    assert [frame[1] for frame in frames] == [0, 1, 2, 1, 2]
    protocol.decode(frames[1])
    decoded = protocol.decode(frames[2])
    assert len(decoded.pulses_us) == 9
    assert math.isclose(decoded.pulses_us[0], 1100, abs_tol=1)
    assert math.isclose(decoded.pulses_us[8], 1900, abs_tol=1)
    assert frames[2][6:] == b"\xff" * 10


@given(st.lists(st.floats(903, 2097), min_size=6, max_size=6), st.booleans())
def test_pulse_widths_survive_to_a_count(pulses: list[float], eleven_bit: bool) -> None:
    protocol = started(DsmpSettings(eleven_bit=eleven_bit))
    protocol.encode(pulses)
    decoded = protocol.decode(protocol.encode(pulses))
    for sent, received in zip(pulses, decoded.pulses_us, strict=True):
        assert math.isclose(sent, received, abs_tol=1.2)


@given(st.binary(max_size=200))
def test_any_answer_is_survived(data: bytes) -> None:
    protocol = started()
    protocol.receive(data, 0.1)
    protocol.receive(bytes(300), 0.2)
    protocol.receive(2 * VERSION_2, 0.3)
    assert protocol.status(2.0).text == "module 2.1"


def test_debug_text_and_telemetry_are_skipped() -> None:
    protocol = started()
    protocol.receive(b"\x00\xab\x04\x01abc" + b"\xaa\x10" + bytes(16) + 2 * VERSION_2, 0.1)
    assert protocol.status(2.0).text == "module 2.1"


@pytest.mark.parametrize(
    "answers",
    [
        VERSION_2,
        VERSION_2 + VERSION_2.replace(b"\x02\x01", b"\x02\x02"),
        3 * (VERSION_2[:6] + b"\x04\x12" + bytes(10)),
    ],
    ids=["once", "two different ones", "unknown"],
)  # fmt: skip
def test_a_version_counts_if_it_is_known_and_reported_twice(answers: bytes) -> None:
    protocol = started()
    protocol.receive(answers, 0.1)
    assert protocol.keepalive_s == 0.02206
    assert "module" not in protocol.status(2.0).text
    protocol.receive(2 * VERSION_2, 0.3)
    assert protocol.status(2.0).text == "module 2.1"


def test_refusals() -> None:
    with pytest.raises(ForbiddenInFlightError):
        started().encode([1100], FrameFlags(bind=True))
    with pytest.raises(PulseRangeError, match="throttle pulse 902"):
        started().encode([902])
    with pytest.raises(FrameDecodeError):
        DsmpProtocol().decode(SETUP)
    with pytest.raises(FrameDecodeError, match="word 1 says it is channel 2"):
        DsmpProtocol().decode(bytes.fromhex("AA 01 06 00 06 00 0A 00 0E 00 12 00 16 00 FF FF"))
    with pytest.raises(ProtocolError, match="channels: 13"):
        DsmpSettings(channels=13)
    with pytest.raises(ProtocolError, match="model: 256"):
        DsmpSettings(model=256)
