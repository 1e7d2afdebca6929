import math
from itertools import pairwise

import pytest
from radio_multi_bench import FRAME_S, Bench, booted, frame

from rcopterx.radios.multi import MultiFrame, MultiProtocol, MultiSettings
from rcopterx.radios.multi_radios import RADIOS
from rcopterx.radios.protocol import ten_bit_count
from rcopterx.simulator.radio_module import SerialInput
from rcopterx.simulator.radio_multi import air_value, killed_throttle, status_answer


@pytest.mark.parametrize(
    ("pulse_us", "on_air_us"), [(1100, 171), (1500, 512), (1540, 546), (1900, 853)], ids=str
)
def test_air_values_are_those_of_the_table(pulse_us: float, on_air_us: int) -> None:
    packet = booted().run(0.1, frame([pulse_us]))[-1]
    assert ten_bit_count(packet.pulses_us[0]) == on_air_us


def test_air_value_limits_are_those_of_the_table() -> None:
    assert (air_value(0), air_value(2047)) == (173, 1874)


@pytest.mark.parametrize(
    ("name", "sent", "six_words"),
    [
        ("M3", [1580, 1400, 1700, 1540], "05aa 16000aaa 0e22 0244 1200"),
        ("M9", [1900, 1100, 1900, 1340], "04ab 16000b55 0d77 0355 1200"),
    ],
)
def test_packets_carry_the_golden_values_of_the_air(name: str, sent: list[float], six_words: str) -> None:
    packet = booted().run(0.1, frame(sent))[-1]
    words = [int.from_bytes(bytes.fromhex(six_words)[i : i + 2], "big") for i in range(0, 12, 2)]
    golden = {word >> 10: word & 0x3FF for word in words}
    assert {i: ten_bit_count(p) for i, p in enumerate(packet.pulses_us)} == golden


def test_channels_are_sent_every_22_ms_and_again_4_ms_later() -> None:
    packets = booted().run(1.0, frame())
    first, again = packets[::2], packets[1::2]
    assert all(math.isclose(b.time_s - a.time_s, 0.022) for a, b in pairwise(first))
    assert all(math.isclose(b.time_s - a.time_s, 0.00401) for a, b in zip(first, again, strict=False))
    assert all(a.pulses_us == b.pulses_us for a, b in zip(first, again, strict=False))


def test_frames_before_power_up_and_the_first_after_it_are_lost() -> None:
    bench = Bench()
    bench.run(0.2, frame())
    assert not bench.module.frames
    bench.run(0.02, frame())
    assert not bench.module.frames
    bench.run(0.02, frame())
    assert len(bench.module.frames) == 1


def test_first_packet_comes_360_to_375_ms_after_power() -> None:
    bench = Bench()
    bench.run(0.5, frame())
    assert 0.360 <= bench.packets[0].time_s <= 0.395


def test_arrival_is_the_last_byte_on_the_wire() -> None:
    bench = booted()
    start_s = bench.now_s
    bench.run(0.02, frame())
    assert math.isclose(bench.module.frames[-1].arrival_s, start_s + FRAME_S)


def test_two_frames_back_to_back_are_both_lost() -> None:
    bench = booted()
    before = len(bench.module.frames)
    bench.run(0.02, frame() + frame())
    assert len(bench.module.frames) == before
    assert bench.module.rejected["wrong length"] == 1


def test_frames_too_close_on_the_wire_are_both_lost_and_apart_both_accepted() -> None:
    for pause_s, accepted in ((0.1e-3, 0), (0.2e-3, 2)):
        bench = booted()
        before = len(bench.module.frames)
        bench.link.module.feed(frame(), bench.now_s)
        bench.link.module.feed(frame(), bench.now_s + FRAME_S + pause_s)
        bench.run(0.02, None)
        assert len(bench.module.frames) - before == accepted


@pytest.mark.parametrize(("length", "accepted"), [(25, False), (26, True), (36, True), (37, False)])
def test_lengths_26_to_36_are_accepted(length: int, accepted: bool) -> None:
    bench = booted()
    before = len(bench.module.frames)
    bench.run(0.02, (frame() + bytes(10))[:length])
    assert (len(bench.module.frames) > before) == accepted


def test_garbage_before_a_frame_is_skipped_but_a_stray_header_gives_wrong_channels() -> None:
    bench = booted()
    bench.run(0.02, b"\x00\xff" + frame())
    assert math.isclose(bench.module.frames[-1].pulses_us[0], 1540, abs_tol=1)
    bench.run(0.02, b"\x55" + frame())
    assert not math.isclose(bench.module.frames[-1].pulses_us[0], 1540, abs_tol=1)


def stopped_in_flight(phase_s: float) -> tuple[Bench, float]:
    """Frames end at some phase of the radio's cycle; also the time from the last frame to the last packet."""
    bench = booted()
    bench.link.module.feed(frame(), bench.now_s + phase_s)
    sent_s = bench.now_s + phase_s
    bench.run(1.0, None)
    return bench, bench.packets[-1].time_s - sent_s


PHASES_S = [n * 0.001 for n in range(22)]


def test_radio_stops_54_to_74_ms_after_the_last_frame_and_resumes_on_the_same_channels() -> None:
    waits_s = []
    for phase_s in PHASES_S:
        bench, waited_s = stopped_in_flight(phase_s)
        waits_s.append(waited_s)
        rf_channels = bench.packets[-1].rf_channels
        resumed = bench.run(0.1, frame())
        assert resumed[0].rf_channels == rf_channels
        assert resumed[0].time_s - (bench.now_s - 0.1) < 0.03
    assert 0.054 <= min(waits_s) <= 0.058
    assert 0.070 <= max(waits_s) <= 0.074


def test_first_packet_after_a_stop_can_be_the_last_one_again_18_ms_before_the_new_one() -> None:
    stale = 0
    for phase_s in PHASES_S:
        bench, _ = stopped_in_flight(phase_s)
        first, *_, last = bench.run(0.1, frame([1100]))
        assert ten_bit_count(last.pulses_us[0]) == 171
        if ten_bit_count(first.pulses_us[0]) == 546:
            stale += 1
            new = next(p for p in bench.packets if p.time_s > first.time_s)
            assert new.pulses_us == last.pulses_us
            assert math.isclose(new.time_s - first.time_s, 0.018, abs_tol=1e-4)
    assert 0.1 < stale / len(PHASES_S) < 0.3


@pytest.mark.parametrize(
    "changed",
    [
        MultiFrame((1024,) * 16, rx_num=4),
        MultiFrame((1024,) * 16, rx_num=3, sub_protocol=2),
        MultiFrame((1024,) * 16, rx_num=19),
    ],
    ids=["rx_num", "sub_protocol", "rx_num upper bits"],
)
def test_restarting_changes_cost_142_ms_and_new_channels(changed: MultiFrame) -> None:
    bench = booted()
    before = bench.packets[-1]
    packets = bench.run(0.5, changed.to_bytes())
    assert packets[0].rf_channels != before.rf_channels
    assert 0.142 <= packets[0].time_s - before.time_s <= 0.142 + 0.022 + 0.02
    assert all(packet.rf_channels == packets[0].rf_channels for packet in packets)


def test_shorter_frame_restarts_the_radio() -> None:
    bench = booted()
    before = bench.packets[-1].rf_channels
    assert bench.run(0.5, frame()[:26])[-1].rf_channels != before


@pytest.mark.parametrize(
    "unchanged",
    [
        MultiFrame((1024,) * 16, rx_num=3, option=7),
        MultiFrame((1024,) * 16, rx_num=3, low_power=True),
        MultiFrame((1024,) * 16, rx_num=3, range_check=True),
        MultiFrame((2047,) * 16, rx_num=3, failsafe=True),
    ],
    ids=["option", "low power", "range check", "failsafe"],
)
def test_other_changes_cause_no_outage(unchanged: MultiFrame) -> None:
    bench = booted()
    rf_channels = bench.packets[-1].rf_channels
    packets = bench.run(0.5, unchanged.to_bytes())
    assert {packet.rf_channels for packet in packets} == {rf_channels}
    assert len(packets) >= 44


def test_failsafe_frames_feed_the_dead_mans_stop_but_change_no_channel() -> None:
    bench = booted()
    packets = bench.run(0.5, MultiFrame((2047,) * 16, rx_num=3, failsafe=True).to_bytes())
    assert ten_bit_count(packets[-1].pulses_us[0]) == 546


def test_radio_resumes_with_a_failsafe_frame_too() -> None:
    bench = booted()
    bench.run(0.5, None)
    assert bench.run(0.1, MultiFrame((2047,) * 16, rx_num=3, failsafe=True).to_bytes())
    assert bench.run(0.1, frame())


def test_wrong_polarity_makes_the_module_deaf_until_power_cycled() -> None:
    bench = booted()
    bench.run(0.02, MultiFrame((1024,) * 16, rx_num=3, inverted_line=False).to_bytes())
    bench.run(0.3, frame())
    assert not bench.run(0.3, frame())
    bench.module.power_cycle(bench.now_s)
    assert bench.run(1.0, frame())


def test_mapping_on_reorders_the_channels() -> None:
    bench = booted()
    mapped = MultiFrame((1100, 1200, 1300, 1400, *([1024] * 12)), rx_num=3, mapping_off=False)
    bench.run(0.1, mapped.to_bytes())
    counts = [round((p - 1500) * 2.05 + 1024) for p in bench.module.frames[-1].pulses_us[:4]]
    assert counts == [1300, 1100, 1200, 1400]


@pytest.mark.parametrize(
    ("value", "forced"), [(1024, None), (605, None), (604, 168), (404, 84), (204, 0), (0, 0)]
)
def test_channel_14_forces_the_throttle_down(value: int, forced: int | None) -> None:
    assert killed_throttle(value) == forced


def test_kill_frame_sends_throttle_zero_whatever_the_throttle_channel_says() -> None:
    bench = booted()
    packet = bench.run(0.1, frame([1900], kill=True))[-1]
    assert ten_bit_count(packet.pulses_us[0]) == 0
    assert bench.module.frames[-1].kill


def test_status_is_the_golden_one_and_comes_every_501_ms() -> None:
    golden = "4D 50 01 18 47 01 03 04 48 E4 46 06 44 53 4D 00 00 00 00 77 32 20 31 46 00 00 00 00"
    assert status_answer(0x47, "DSM", "2 1F") == bytes.fromhex(golden)
    bench = booted()
    bench.statuses()
    bench.run(5.02, frame())
    assert len(bench.statuses()) == 10


def test_status_follows_an_initialisation_and_reports_lost_input() -> None:
    bench = booted()
    bench.statuses()
    bench.run(0.2, MultiFrame((1024,) * 16, rx_num=4).to_bytes())
    assert bench.statuses()[0].judged("DSM").ready
    bench.run(1.0, None)
    assert not bench.statuses()[-1].flags & 0x01


def test_eu_build_refuses_dsm2_half_a_second_after_a_status_like_that_of_a_ready_module() -> None:
    bench = Bench()
    bench.module.knows_dsm2 = False
    bench.run(2.0, frame())
    first, *later = bench.statuses()
    assert (first.flags, first.protocol, first.sub_protocol) == (0x47, "DSM", "--->")
    assert not first.judged("DSM").ready
    assert {(status.flags, status.protocol) for status in later} == {(0x03, "")}
    assert not bench.packets


def test_eu_build_transmits_dsmx() -> None:
    bench = Bench()
    bench.module.knows_dsm2 = False
    bench.run(2.0, MultiFrame((1024,) * 16, rx_num=3, sub_protocol=2).to_bytes())
    assert bench.statuses()[-1].judged("DSM").ready
    assert bench.packets


def test_answers_can_be_switched_off() -> None:
    bench = Bench()
    bench.run(2.0, MultiFrame((1024,) * 16, rx_num=3, telemetry_off=True).to_bytes())
    assert not bench.answers


def test_eleven_ms_mode_sends_twice_as_often() -> None:
    bench = Bench()
    bench.run(1.0, MultiFrame((1024,) * 16, rx_num=3, sub_protocol=1, option=0x46).to_bytes())
    times = [packet.time_s for packet in bench.packets]
    assert math.isclose(times[-1] - times[-3], 0.011)


def test_bytes_of_one_read_are_back_to_back_after_those_before() -> None:
    line = SerialInput(120e-6, 250e-6)
    line.feed(bytes(27), 1.0)
    line.feed(bytes(3), 1.001)
    assert math.isclose(line.end_s, 1.0 + 30 * 120e-6)
    end_s, data = line.take()
    assert (len(data), math.isclose(end_s, line.end_s)) == (30, True)


@pytest.mark.parametrize("radio", RADIOS)
def test_every_radio_of_the_driver_reaches_its_vehicle(radio: str) -> None:
    protocol = MultiProtocol(MultiSettings(rx_num=3, radio=radio, sub_protocol=0))
    protocol.link_opened(0.0)
    bench = Bench()
    sent = (1200.0, 1300.0, 1400.0, 1600.0)
    bench.run(5.0, protocol.encode(sent))
    protocol.receive(bench.answers, bench.now_s)
    assert protocol.status(bench.now_s).ready, protocol.status(bench.now_s).text
    assert radio in protocol.status(bench.now_s).text
    assert bench.packets[-1].pulses_us[:4] == pytest.approx(sent, abs=1.5)
    assert len(bench.packets[-1].pulses_us) <= RADIOS[radio].channels
