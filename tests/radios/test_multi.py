import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.multi import (
    MultiFrame,
    MultiProtocol,
    MultiSettings,
    count_of,
    pack_channels,
    pulse_of,
)
from rcopterx.radios.protocol import (
    ForbiddenInFlightError,
    FrameDecodeError,
    FrameFlags,
    ProtocolError,
    PulseRangeError,
    SerialLine,
)

LOW = 204
MID = 1024


def counts(*first: int, **others: int) -> tuple[int, ...]:
    values = [*first, *([MID] * (16 - len(first)))]
    for name, value in others.items():
        values[int(name.removeprefix("ch")) - 1] = value
    return tuple(values)


# Frames of EdgeTX, `pulses/multi.cpp`, accepted by DIY-Multiprotocol-TX-Module
GOLDEN = {
    "M1 neutral, throttle low": (
        MultiFrame(counts(LOW), rx_num=3),
        "55 06 03 06 CC 00 20 00 01 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M2 hover": (
        MultiFrame(counts(1106), rx_num=3),
        "55 06 03 06 52 04 20 00 01 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M3 u = (.5, -.25, .6, .1)": (
        MultiFrame(counts(1188, 819, 1434, 1106), rx_num=3),
        "55 06 03 06 A4 9C 99 66 A5 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M4 bind, throttle low": (
        MultiFrame(counts(LOW), rx_num=3, bind=True),
        "55 86 03 06 CC 00 20 00 01 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M5 range check, hover": (
        MultiFrame(counts(1106), rx_num=3, range_check=True),
        "55 26 03 06 52 04 20 00 01 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M6 kill": (
        MultiFrame(counts(LOW, ch14=204), rx_num=3),
        "55 06 03 06 CC 00 20 00 01 08 40 00 02 10 80 00 04 20 00 01 08 40 66 00 10 80 09",
    ),
    "M7 low power, 7 channels, hover": (
        MultiFrame(counts(1106), rx_num=3, low_power=True, option=7),
        "55 06 83 07 52 04 20 00 01 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M8 failsafe T = 204, rest hold": (
        MultiFrame((204, *([2047] * 15)), rx_num=3, failsafe=True),
        "57 06 03 06 CC F8 FF FF FF FF FF FF FF FF FF FF FF FF FF FF FF FF FF FF FF FF 09",
    ),
    "M9 limits (1, -1, 1, -.4)": (
        MultiFrame(counts(1844, 204, 1844, 696), rx_num=3),
        "55 06 03 06 34 67 06 CD 71 05 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 09",
    ),
    "M10 RxNum 37, sub 1, AETR mapping on, not inverted": (
        MultiFrame(
            counts(1024, 1024, 204), rx_num=37, sub_protocol=1, inverted_line=False, mapping_off=False
        ),
        "55 06 15 06 00 04 20 33 00 08 40 00 02 10 80 00 04 20 00 01 08 40 00 02 10 80 20",
    ),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_frame_fields_encode_to_the_golden_bytes(name: str) -> None:
    frame, expected = GOLDEN[name]
    assert frame.to_bytes() == bytes.fromhex(expected)


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_bytes_decode_to_the_frame_fields(name: str) -> None:
    frame, expected = GOLDEN[name]
    assert MultiFrame.from_bytes(bytes.fromhex(expected)) == frame


@pytest.mark.parametrize(
    ("name", "pulses", "flags"),
    [
        ("M1 neutral, throttle low", [1100], FrameFlags()),
        ("M2 hover", [1540], FrameFlags()),
        ("M3 u = (.5, -.25, .6, .1)", [1580, 1400, 1700, 1540], FrameFlags()),
        ("M4 bind, throttle low", [1100], FrameFlags(bind=True)),
        ("M5 range check, hover", [1540], FrameFlags(range_check=True)),
        ("M6 kill", [1100], FrameFlags(kill=True)),
        ("M9 limits (1, -1, 1, -.4)", [1900, 1100, 1900, 1340], FrameFlags()),
    ],
)
def test_pulse_widths_encode_to_the_golden_bytes(name: str, pulses: list[float], flags: FrameFlags) -> None:
    protocol = MultiProtocol(MultiSettings(rx_num=3))
    assert protocol.encode(pulses, flags, disarmed=True) == bytes.fromhex(GOLDEN[name][1])


def test_low_power_and_seven_channels_encode_to_the_golden_bytes() -> None:
    protocol = MultiProtocol(MultiSettings(rx_num=3, channels=7))
    name = "M7 low power, 7 channels, hover"
    assert protocol.encode([1540], FrameFlags(low_power=True)) == bytes.fromhex(GOLDEN[name][1])


@given(st.integers(0, 2047))
def test_counts_survive_the_way_through_pulse_widths(count: int) -> None:
    assert count_of(pulse_of(count)) == count


@given(
    st.builds(
        MultiFrame,
        counts=st.lists(st.integers(0, 2047), min_size=16, max_size=16).map(tuple),
        protocol=st.integers(0, 255),
        sub_protocol=st.integers(0, 7),
        rx_num=st.integers(0, 63),
        option=st.integers(0, 255),
    )
)
def test_every_frame_survives_encoding_and_decoding(frame: MultiFrame) -> None:
    assert MultiFrame.from_bytes(frame.to_bytes()) == frame


@given(st.lists(st.floats(1000, 2000), max_size=16), st.booleans(), st.booleans())
def test_pulse_widths_survive_to_half_a_count(
    pulses: list[float], range_check: bool, low_power: bool
) -> None:
    protocol = MultiProtocol()
    flags = FrameFlags(range_check=range_check, low_power=low_power)
    fields = MultiFrame.from_bytes(protocol.encode(pulses, flags))
    for sent, count in zip(pulses, fields.ordered_counts, strict=False):
        assert math.isclose(sent, pulse_of(count), abs_tol=1.0)
    assert (fields.range_check, fields.low_power) == (range_check, low_power)


@pytest.mark.parametrize("bad", [999.0, 2001.0, math.nan, math.inf])
def test_pulse_width_out_of_range_raises_and_names_the_channel(bad: float) -> None:
    with pytest.raises(PulseRangeError, match=r"elevator pulse .* outside 1000..2000 us"):
        MultiProtocol().encode([1100, 1500, bad])


def test_too_many_channels_raise() -> None:
    with pytest.raises(PulseRangeError, match="17 channels given, 16 are possible"):
        MultiProtocol().encode([1500] * 17)


def test_counts_out_of_range_raise() -> None:
    with pytest.raises(PulseRangeError, match="channel 3 value 2048"):
        pack_channels([0, 0, 2048, *([0] * 13)])
    with pytest.raises(PulseRangeError, match="exactly 16"):
        pack_channels([0] * 15)


def test_binding_is_refused_unless_disarmed() -> None:
    with pytest.raises(ForbiddenInFlightError, match="disarm first"):
        MultiProtocol().encode([1100], FrameFlags(bind=True))


@given(st.booleans(), st.booleans(), st.booleans(), st.booleans())
def test_autobind_and_mapping_are_never_asked_for(bind: bool, check: bool, kill: bool, low: bool) -> None:
    frame = MultiProtocol().encode([1100], FrameFlags(bind, check, kill, low), disarmed=True)
    fields = MultiFrame.from_bytes(frame)
    assert not fields.autobind
    assert fields.mapping_off
    assert len(frame) == 27


@pytest.mark.parametrize(
    ("field", "value"),
    [("rx_num", 64), ("rx_num", -1), ("sub_protocol", 4), ("channels", 2), ("channels", 13), ("option", 128)],
)
def test_settings_out_of_range_name_the_field(field: str, value: int) -> None:
    with pytest.raises(ProtocolError, match=f"multi.{field}: {value} is outside"):
        MultiSettings(**{field: value})


@pytest.mark.parametrize("length", [0, 25, 37])
def test_frames_of_wrong_length_are_refused(length: int) -> None:
    with pytest.raises(FrameDecodeError, match=f"{length} bytes"):
        MultiFrame.from_bytes(bytes([0x55]) * length)


def test_frames_with_another_header_are_refused() -> None:
    with pytest.raises(FrameDecodeError, match="header 0x58"):
        MultiFrame.from_bytes(bytes([0x58]) * 27)


def test_legacy_frame_of_26_bytes_decodes_without_the_last_byte() -> None:
    frame, golden = GOLDEN["M1 neutral, throttle low"]
    decoded = MultiFrame.from_bytes(bytes.fromhex(golden)[:26])
    assert decoded.counts == frame.counts
    assert not decoded.mapping_off


def test_wire_time_of_a_frame_is_3_24_ms() -> None:
    assert math.isclose(SerialLine(100_000, "E", 2).duration_s(27), 3.24e-3)
    assert MultiProtocol().minimum_interval_s >= 3.24e-3 + 1e-3


def test_a_radio_other_than_dsm_gets_its_number_option_and_line_order() -> None:
    settings = MultiSettings(rx_num=3, radio="OMP", option=-20)
    protocol = MultiProtocol(settings)
    frame = protocol.encode((1100.0, 1200.0, 1300.0, 1400.0, 1900.0), FrameFlags(kill=True))
    fields = MultiFrame.from_bytes(frame)
    assert (fields.protocol, fields.sub_protocol, fields.option, fields.mapping_off) == (77, 0, 236, False)
    assert fields.counts[:5] == tuple(map(count_of, (1200.0, 1300.0, 1100.0, 1400.0, 1900.0)))
    assert not fields.kills, "channel 14 means something else there"
    assert fields.ordered_counts[:2] == (count_of(1100.0), count_of(1200.0))


@pytest.mark.parametrize(("radio", "sub_protocol"), [("Morse", 0), ("E129", 2), ("CFlie", 1)])
def test_unknown_radios_and_sub_protocols_are_refused(radio: str, sub_protocol: int) -> None:
    with pytest.raises(
        ProtocolError, match=r"multi\.(radio: 'Morse' is unknown|sub_protocol: \d is outside)"
    ):
        MultiSettings(radio=radio, sub_protocol=sub_protocol)


def test_channels_that_rest_low_do_not_kill_a_dsm_receiver() -> None:
    protocol = MultiProtocol(MultiSettings(rx_num=3))
    protocol.rest_us = 1100.0
    fields = MultiFrame.from_bytes(protocol.encode([1540.0]))
    assert not fields.kills
    assert fields.counts[12] == count_of(1100.0)
