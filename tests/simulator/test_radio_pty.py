import os
import select
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.radios import serve

from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import HOLD_S, Receiver

FRAME = MultiProtocol(MultiSettings(rx_num=3)).encode([1540])


@pytest.fixture
def radio(tmp_path: Path) -> Iterator[RadioPty]:
    pty = RadioPty(tmp_path / "radios" / "h1", RadioLink(MultiModule(0.0), Receiver(3, connect_s=0.0)))
    yield pty
    pty.unplug()


def opened(radio: RadioPty) -> int:
    return os.open(radio.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def write_and_service(radio: RadioPty, descriptor: int, data: bytes, now_s: float) -> None:
    os.write(descriptor, data)
    assert select.select([radio.fileno()], [], [], 60.0)[0]
    serve(radio, now_s)


def flying(radio: RadioPty) -> int:
    """Write frames until the module answers to them; nothing waits at time 1.0."""
    descriptor = opened(radio)
    for n in range(50):
        write_and_service(radio, descriptor, FRAME, n * 0.02)
    serve(radio, 1.0)
    radio.link.take_frames()
    return descriptor


def test_written_frames_reach_the_receiver_and_answers_come_back(radio: RadioPty) -> None:
    descriptor = opened(radio)
    for n in range(100):
        write_and_service(radio, descriptor, FRAME, n * 0.02)
    assert radio.link.receiver.pulses_us(2.0)[0] == pytest.approx(1540, abs=1.5)
    assert len(radio.link.take_frames()) > 80
    assert not radio.link.take_frames()
    assert b"MP\x01\x18\x47" in os.read(descriptor, 4096)
    os.close(descriptor)


def test_stale_link_of_a_killed_process_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "h1"
    path.symlink_to("/dev/pts/this-one-is-gone")
    radio = RadioPty(path, RadioLink(MultiModule(0.0), Receiver(3)))
    os.close(opened(radio))
    radio.unplug()
    assert not path.is_symlink()


def test_a_file_in_the_way_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "h1"
    path.write_text("precious")
    with pytest.raises(FileExistsError, match="not a symbolic link"):
        RadioPty(path, RadioLink(MultiModule(0.0), Receiver(3)))
    assert path.read_text() == "precious"


def test_close_leaves_a_link_that_belongs_to_somebody_else(radio: RadioPty) -> None:
    radio.path.unlink()
    radio.path.symlink_to("/dev/null")
    radio.unplug()
    assert radio.path.is_symlink()
    assert radio.fileno() == -1


def test_unplugging_hangs_up_and_replugging_boots_the_module(radio: RadioPty) -> None:
    descriptor = opened(radio)
    for n in range(50):
        write_and_service(radio, descriptor, FRAME, n * 0.02)
    before = radio.link.module.take_packets(), radio.link.module
    radio.unplug()
    radio.unplug()
    with pytest.raises(OSError, match="Input/output error"):
        os.write(descriptor, FRAME)
    os.close(descriptor)
    assert not radio.path.exists()
    serve(radio, 1.1)
    radio.replug(2.0)
    descriptor = opened(radio)
    write_and_service(radio, descriptor, FRAME, 2.01)
    serve(radio, 2.1)
    assert radio.link.module.rejected["before power-up was complete"] > len(before[0])
    os.close(descriptor)


def test_frames_that_piled_up_while_nobody_looked_are_told_apart(radio: RadioPty) -> None:
    descriptor = flying(radio)
    write_and_service(radio, descriptor, FRAME + FRAME, 1.05)
    serve(radio, 1.06)
    assert len(radio.link.take_frames()) == 2
    assert radio.counters["late services"] == 1
    os.close(descriptor)


def test_frames_glued_together_are_lost_when_somebody_looks_in_time(radio: RadioPty) -> None:
    descriptor = flying(radio)
    write_and_service(radio, descriptor, FRAME + FRAME, 1.001)
    serve(radio, 1.05)
    assert not radio.link.take_frames()
    os.close(descriptor)


def test_unread_answers_do_not_block_the_simulator(radio: RadioPty) -> None:
    descriptor = opened(radio)
    now_s = 0.0
    while not radio.counters["unread answers"] and now_s < 2000:
        write_and_service(radio, descriptor, FRAME, now_s)
        now_s += 0.02 if now_s < 1 else 0.5
    assert radio.counters["unread answers"]
    os.close(descriptor)


@pytest.mark.parametrize("fail", [RadioPty.unplug, RadioPty.switch_off])
def test_vehicle_of_a_module_without_power_is_told_when_its_receiver_gives_up(
    radio: RadioPty, fail: Callable[[RadioPty], None]
) -> None:
    descriptor = flying(radio)
    assert radio.link.take_outputs()[-1][1][0] == pytest.approx(1540, abs=1.5)
    fail(radio)
    radio.advance(1.2)
    assert not radio.link.take_outputs()
    radio.advance(1.0 + HOLD_S)
    [(given_s, pulses_us)] = radio.link.take_outputs()
    assert given_s == 1.0 + HOLD_S
    assert pulses_us[0] == 1100.0
    os.close(descriptor)
