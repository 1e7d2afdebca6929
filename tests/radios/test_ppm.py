import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.ppm import PpmGenProtocol, PpmSettings
from rcopterx.radios.protocol import (
    FrameDecodeError,
    FrameFlags,
    ProtocolError,
    PulseRangeError,
)

# A frame of isleder/ppm-gen: 1100 + 5 x 1500 us
GOLDEN = bytes.fromhex("01 11 01 4C 04 DC 05 DC 05 DC 05 DC 05 DC 05 C8 04")


def test_ppm_gen_packet_is_the_golden_one() -> None:
    assert PpmGenProtocol().encode([1100]) == GOLDEN


def test_golden_ppm_gen_packet_decodes() -> None:
    assert PpmGenProtocol().decode(GOLDEN).pulses_us == (1100, 1500, 1500, 1500, 1500, 1500)


def test_channels_are_arranged_as_the_radio_expects_them() -> None:
    protocol = PpmGenProtocol(PpmSettings(order="AETR"))
    packet = protocol.encode([1100, 1200, 1300, 1400])
    assert [int.from_bytes(packet[i : i + 2], "little") for i in (3, 5, 7, 9)] == [1200, 1300, 1100, 1400]
    assert protocol.decode(packet).pulses_us[:4] == (1100, 1200, 1300, 1400)


@given(
    st.integers(4, 8).flatmap(lambda n: st.lists(st.integers(800, 2200), min_size=n, max_size=n)),
    st.permutations("TAER").map("".join),
)
def test_every_packet_survives_encoding_and_decoding(pulses: list[int], order: str) -> None:
    protocol = PpmGenProtocol(PpmSettings(channels=len(pulses), order=order))
    assert protocol.decode(protocol.encode(pulses)).pulses_us == tuple(pulses)


def test_what_the_radio_itself_does_cannot_be_asked_for() -> None:
    for flags in (FrameFlags(bind=True), FrameFlags(range_check=True), FrameFlags(low_power=True)):
        with pytest.raises(ProtocolError, match="cannot be asked for"):
            PpmGenProtocol().encode([1100], flags, disarmed=True)
    with pytest.raises(PulseRangeError, match="throttle pulse 799"):
        PpmGenProtocol().encode([799])
    assert PpmGenProtocol().encode([1100], FrameFlags(kill=True)) == PpmGenProtocol().encode([1100])


@pytest.mark.parametrize("position", range(len(GOLDEN)))
def test_a_packet_with_any_byte_changed_is_refused(position: int) -> None:
    broken = bytearray(GOLDEN)
    broken[position] ^= 0x01
    with pytest.raises(FrameDecodeError):
        PpmGenProtocol().decode(bytes(broken))


def test_wrong_settings_name_the_field() -> None:
    with pytest.raises(ProtocolError, match="channels: 9"):
        PpmSettings(channels=9)
    with pytest.raises(ProtocolError, match="order: 'TAEE'"):
        PpmSettings(order="TAEE")
