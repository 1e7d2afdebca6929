import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.dsm2_serial import Dsm2SerialProtocol, Dsm2Settings
from rcopterx.radios.protocol import (
    ForbiddenInFlightError,
    FrameDecodeError,
    FrameFlags,
    ProtocolError,
    PulseRangeError,
    ten_bit_count,
    ten_bit_pulse_us,
)

MIDDLE = [512] * 6
LOW = [169, 512, 512, 512, 512, 512]

# Frames of EdgeTX, `pulses/dsm2.cpp`: settings, flags, pulse widths, counts, frame
GOLDEN = {
    "S1": (Dsm2Settings(3), FrameFlags(), [1100], LOW, "10 03 00 A9 06 00 0A 00 0E 00 12 00 16 00"),
    "S2": (
        Dsm2Settings(3),
        FrameFlags(),
        [1540],
        [546, *MIDDLE[1:]],
        "10 03 02 22 06 00 0A 00 0E 00 12 00 16 00",
    ),
    "S3": (
        Dsm2Settings(3),
        FrameFlags(),
        [1580, 1400, 1700, 1540],
        [581, 426, 684, 546, 512, 512],
        "10 03 02 45 05 AA 0A AC 0E 22 12 00 16 00",
    ),
    "S4": (Dsm2Settings(3), FrameFlags(bind=True), [1100], LOW, "90 03 00 A9 06 00 0A 00 0E 00 12 00 16 00"),
    "S5": (
        Dsm2Settings(3),
        FrameFlags(range_check=True),
        [1540],
        [546, *MIDDLE[1:]],
        "30 03 02 22 06 00 0A 00 0E 00 12 00 16 00",
    ),
    "S6": (
        Dsm2Settings(0),
        FrameFlags(),
        [903, 2097, 903, 2097],
        [0, 1023, 0, 1023, 512, 512],
        "10 00 00 00 07 FF 08 00 0F FF 12 00 16 00",
    ),
    "S7": (
        Dsm2Settings(1, "dsmx"),
        FrameFlags(),
        [1500],
        MIDDLE,
        "18 01 02 00 06 00 0A 00 0E 00 12 00 16 00",
    ),
    "S8": (Dsm2Settings(0, "lp"), FrameFlags(), [1100], LOW, "00 00 00 A9 06 00 0A 00 0E 00 12 00 16 00"),
    "S9": (
        Dsm2Settings(3),
        FrameFlags(),
        [1900, 1100, 1900, 1340],
        [855, 169, 855, 375, 512, 512],
        "10 03 03 57 04 A9 0B 57 0D 77 12 00 16 00",
    ),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_pulse_widths_encode_to_the_golden_frames(name: str) -> None:
    settings, flags, pulses, _, frame = GOLDEN[name]
    assert Dsm2SerialProtocol(settings).encode(pulses, flags, disarmed=True) == bytes.fromhex(frame)


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_frames_decode_to_counts_and_flags(name: str) -> None:
    settings, flags, _, counts, frame = GOLDEN[name]
    decoded = Dsm2SerialProtocol(settings).decode(bytes.fromhex(frame))
    assert [ten_bit_count(pulse) for pulse in decoded.pulses_us] == counts
    assert decoded.flags == flags


@given(st.integers(0, 1023))
def test_ten_bit_counts_survive_the_way_through_pulse_widths(count: int) -> None:
    assert ten_bit_count(ten_bit_pulse_us(count)) == count


@given(st.lists(st.floats(903, 2097), max_size=6))
def test_pulse_widths_survive_to_a_count(pulses: list[float]) -> None:
    protocol = Dsm2SerialProtocol()
    decoded = protocol.decode(protocol.encode(pulses))
    for sent, received in zip(pulses, decoded.pulses_us, strict=False):
        assert math.isclose(sent, received, abs_tol=1.2)


def test_out_of_range_raises() -> None:
    with pytest.raises(PulseRangeError, match="rudder pulse 2098"):
        Dsm2SerialProtocol().encode([1500, 1500, 1500, 2098])
    with pytest.raises(PulseRangeError, match="7 channels"):
        Dsm2SerialProtocol().encode([1500] * 7)


def test_binding_needs_a_disarmed_vehicle_and_excludes_a_range_check() -> None:
    protocol = Dsm2SerialProtocol()
    with pytest.raises(ForbiddenInFlightError):
        protocol.encode([1100], FrameFlags(bind=True))
    with pytest.raises(ProtocolError, match="together"):
        protocol.encode([1100], FrameFlags(bind=True, range_check=True), disarmed=True)


def test_low_power_is_refused() -> None:
    with pytest.raises(ProtocolError, match="low_power cannot be asked for"):
        Dsm2SerialProtocol().encode([1100], FrameFlags(low_power=True))


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("10 03 00 A9", "4 bytes"),
        ("11 03 00 A9 06 00 0A 00 0E 00 12 00 16 00", "header 0x11"),
        ("10 03 00 A9 0A 00 0A 00 0E 00 12 00 16 00", "word 2 says it is channel 3"),
    ],
)
def test_broken_frames_are_refused(frame: str, words: str) -> None:
    with pytest.raises(FrameDecodeError, match=words):
        Dsm2SerialProtocol().decode(bytes.fromhex(frame))


def test_wrong_settings_name_the_field() -> None:
    with pytest.raises(ProtocolError, match=r"model: 64 is outside 0\.\.63"):
        Dsm2Settings(64)
    with pytest.raises(ProtocolError, match="family: 'dx' is unknown"):
        Dsm2Settings(0, "dx")


def test_radio_without_answers_is_ready_after_settling() -> None:
    protocol = Dsm2SerialProtocol()
    assert protocol.status(0.0).text == "port not open"
    protocol.link_opened(0.0)
    protocol.receive(b"noise", 0.1)
    assert not protocol.status(0.9).ready
    assert protocol.status(1.0).ready
    assert protocol.minimum_interval_s == protocol.keepalive_s == 0.022
    protocol.link_opened(2.0)
    assert not protocol.status(2.0).ready
    protocol.link_resumed(3.0)
    assert protocol.status(3.0).ready
