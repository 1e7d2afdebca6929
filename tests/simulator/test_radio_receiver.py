import pytest
from support.radios import HandheldReceiver

from rcopterx.simulator.radio_module import AirPacket
from rcopterx.simulator.radio_receiver import HOLD_S, Receiver, ReceiverState

HOVER = (1540.0, 1450.0, 1520.0, 1500.0, 1500.0, 1500.0)


def packet(time_s: float, *, rf_channels: int = 1, model_match: int = 3, weak: bool = False) -> AirPacket:
    return AirPacket(time_s, rf_channels, model_match, HOVER, weak=weak)


def stream(receiver: Receiver, start_s: float, end_s: float, **fields: int) -> None:
    for n in range(round((end_s - start_s) / 0.022)):
        receiver.receive(packet(start_s + n * 0.022, **fields))


def linked(until_s: float = 4.0) -> Receiver:
    receiver = Receiver(3, connect_s=2.0)
    stream(receiver, 0.0, until_s)
    return receiver


def test_no_throttle_before_the_module_is_found() -> None:
    receiver = Receiver(3, connect_s=2.0)
    stream(receiver, 0.0, 1.9)
    assert receiver.state(1.9) is ReceiverState.SEARCHING
    assert receiver.pulses_us(1.9)[0] == 1100


def test_channels_are_given_out_once_linked() -> None:
    receiver = linked()
    assert receiver.state(4.0) is ReceiverState.LINKED
    assert receiver.pulses_us(4.0)[:6] == HOVER


def test_another_model_match_number_is_ignored() -> None:
    receiver = Receiver(4, connect_s=0.0)
    stream(receiver, 0.0, 4.0)
    assert receiver.state(4.0) is ReceiverState.SEARCHING


def test_lost_signal_holds_for_a_second_then_cuts_only_the_throttle() -> None:
    receiver = linked()
    assert receiver.state(4.0 + 0.9) is ReceiverState.HOLD
    assert receiver.pulses_us(4.0 + 0.9)[:6] == HOVER
    assert receiver.state(4.0 + HOLD_S) is ReceiverState.FAILSAFE
    assert receiver.pulses_us(4.0 + HOLD_S)[:6] == (1100.0, *HOVER[1:])


def test_control_returns_at_once_on_unchanged_channels() -> None:
    receiver = linked()
    receiver.receive(packet(9.0))
    assert receiver.state(9.01) is ReceiverState.LINKED


def test_new_radio_channels_cost_hold_and_a_new_search() -> None:
    receiver = linked(4.0)
    stream(receiver, 4.0, 8.0, rf_channels=2)
    assert receiver.state(4.9) is not ReceiverState.SEARCHING
    lost = linked(4.0)
    stream(lost, 4.0, 6.8, rf_channels=2)
    assert lost.state(6.8) is ReceiverState.FAILSAFE
    stream(lost, 6.8, 7.1, rf_channels=2)
    assert lost.state(7.1) is ReceiverState.LINKED


def test_power_cycle_searches_again() -> None:
    receiver = linked()
    receiver.power_cycle()
    assert receiver.state(4.0) is ReceiverState.SEARCHING


def test_weak_packets_do_not_reach_a_receiver_too_far_away() -> None:
    near, far = Receiver(3, connect_s=0.0), HandheldReceiver(3, connect_s=0.0, in_range_check_reach=False)
    for receiver in (near, far):
        receiver.receive(packet(0.0, weak=True))
    assert near.state(0.0) is ReceiverState.LINKED
    assert far.state(0.0) is ReceiverState.SEARCHING


@pytest.mark.parametrize(("throttle", "stored"), [(1120.0, 1120.0), (1180.0, 1180.0)])
def test_throttle_at_bind_becomes_the_failsafe(throttle: float, stored: float) -> None:
    receiver = HandheldReceiver(None, connect_s=0.0)
    receiver.enter_bind_mode()
    assert receiver.binding
    for n in range(20):
        receiver.receive(AirPacket(n * 0.01, 1, 7, (), bind=True))
    for n in range(500):
        pulses = (throttle if n < 300 else 1700.0, *HOVER[1:])
        receiver.receive(AirPacket(1.0 + n * 0.022, 1, 7, pulses))
    assert receiver.state(100.0) is ReceiverState.FAILSAFE
    assert receiver.pulses_us(100.0)[0] == stored
