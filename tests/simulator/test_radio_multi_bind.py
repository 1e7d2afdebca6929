"""Binding with the emulated Multiprotocol module."""

import math

from radio_multi_bench import HOVER, Bench, booted, frame
from support.radios import HandheldReceiver

from rcopterx.radios.multi import MultiFrame, MultiProtocol, MultiSettings
from rcopterx.simulator.radio_receiver import ReceiverState


def test_autobind_stops_the_radio() -> None:
    bench = booted()
    assert not bench.run(1.0, MultiFrame((1024,) * 16, rx_num=3, autobind=True).to_bytes())


def test_bind_sends_181_packets_listens_and_resumes_after_6_s() -> None:
    receiver = HandheldReceiver(None, connect_s=0.0)
    receiver.enter_bind_mode()
    bench = booted(receiver)
    bench.statuses()
    start_s = bench.now_s
    packets = bench.run(8.0, frame([1100], bind=True))
    binds = [packet for packet in packets if packet.bind]
    assert len(binds) == 181
    assert math.isclose(binds[0].time_s - start_s, 0.13, abs_tol=0.01)
    assert math.isclose(binds[1].time_s - binds[0].time_s, 0.01)
    resumed = next(packet for packet in packets if not packet.bind and packet.time_s > start_s + 1)
    assert math.isclose(resumed.time_s - start_s, 6.16, abs_tol=0.02)
    assert any(status.binding for status in bench.statuses())
    assert receiver.model_match == 3
    assert receiver.state(bench.now_s) is ReceiverState.LINKED


def test_status_shows_the_end_of_a_bind_up_to_half_a_second_late() -> None:
    bench = booted()
    start_s = bench.now_s
    ended_s = None
    while ended_s is None:
        bench.run(0.02, frame(bind=True))
        statuses = bench.statuses()
        if bench.now_s - start_s > 0.2 and statuses and not statuses[-1].binding:
            ended_s = bench.now_s - start_s
    assert 6.16 <= ended_s <= 6.7


def test_a_bind_changes_the_radio_channels() -> None:
    bench = booted()
    before = bench.packets[-1].rf_channels
    assert bench.run(8.0, frame(bind=True))[-1].rf_channels != before


def test_clearing_the_bind_bit_early_leaves_three_packets_and_the_whole_time_of_listening() -> None:
    bench = booted()
    bench.run(0.5, frame(bind=True))
    cleared_s = bench.now_s
    packets = bench.run(6.0, frame())
    assert sum(packet.bind for packet in packets) == 3
    resumed = next(packet for packet in packets if not packet.bind)
    assert math.isclose(resumed.time_s - cleared_s, 4.25, abs_tol=0.02)


def test_clearing_the_bind_bit_while_the_module_listens_changes_nothing() -> None:
    bench = booted()
    start_s = bench.now_s
    bench.run(3.0, frame(bind=True))
    resumed = next(packet for packet in bench.run(6.0, frame()) if not packet.bind)
    assert math.isclose(resumed.time_s - start_s, 6.16, abs_tol=0.02)


def test_frames_that_stop_freeze_a_bind_until_they_return() -> None:
    bench = booted()
    before = sum(packet.bind for packet in bench.run(1.0, frame(bind=True)))
    before += sum(packet.bind for packet in bench.run(0.1, None))
    assert not bench.run(5.0, None)
    after = bench.run(8.0, frame(bind=True))
    assert before + sum(packet.bind for packet in after) == 181


def test_keeping_the_bind_bit_set_does_not_bind_again() -> None:
    bench = booted()
    bench.run(7.0, frame(bind=True))
    assert not any(packet.bind for packet in bench.run(2.0, frame(bind=True)))


def test_a_radio_that_binds_by_itself_is_ready_afterwards() -> None:
    protocol = MultiProtocol(MultiSettings(rx_num=3, radio="E129", sub_protocol=1))
    bench = Bench()
    bench.run(2.0, protocol.encode(HOVER))
    assert bench.statuses()[-1].binding
    assert not bench.packets
    bench.run(2.0, protocol.encode(HOVER))
    status = bench.statuses()[-1]
    assert (status.protocol, status.sub_protocol, status.binding) == ("E129", "C186", False)
    assert bench.packets
