import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.radios.multi_answers import AnswerParser, MultiStatus

# Answers of DIY-Multiprotocol-TX-Module
READY = bytes.fromhex("4D 50 01 18 47 01 03 04 48 E4 46 06 44 53 4D 00 00 00 00 77 32 20 31 46 00 00 00 00")
BIND_ANSWER = bytes.fromhex("4D 50 05 0A ED CB A9 84 01 07 01 00 04 5E")


def with_flags(flags: int) -> bytes:
    return READY[:4] + bytes((flags,)) + READY[5:]


UNKNOWN_PROTOCOL = READY[:4] + bytes((0x03,)) + READY[5:12] + bytes(16)


def test_ready_example_parses() -> None:
    (status,) = AnswerParser().feed(READY)
    assert status == MultiStatus(0x47, (1, 3, 4, 72), "AETR", "DSM", "2 1F")
    assert status.judged("DSM").ready
    assert not status.binding


def test_binding_example_is_not_ready() -> None:
    (status,) = AnswerParser().feed(with_flags(0x4F))
    assert status.binding
    assert not status.judged("DSM").ready


def test_answers_that_are_no_status_are_skipped() -> None:
    telemetry = b"MP\x04\x11\x50" + bytes(range(16))
    sync = b"MP\x08\x06\x55\xf0\x00\x64\x14\x02"
    unknown, short = b"MP\x77\x02ab", b"MP\x01\x02ab"
    stream = telemetry + sync + unknown + BIND_ANSWER + short + READY
    assert AnswerParser().feed(stream) == AnswerParser().feed(READY)


def test_answer_longer_than_40_bytes_is_skipped() -> None:
    assert AnswerParser().feed(b"MP\x01\x29" + READY) == AnswerParser().feed(READY)


@given(st.binary(max_size=30).filter(lambda b: b"M" not in b), st.lists(st.integers(1, 20), max_size=40))
def test_answers_are_found_however_the_stream_is_cut(garbage: bytes, cuts: list[int]) -> None:
    stream = garbage + READY + garbage + BIND_ANSWER + READY
    parser = AnswerParser()
    answers = []
    for cut in [*cuts, len(stream)]:
        answers += parser.feed(stream[:cut])
        stream = stream[cut:]
    answers += parser.feed(stream)
    assert answers == 2 * AnswerParser().feed(READY)


@given(st.binary(max_size=300))
def test_any_bytes_are_survived(data: bytes) -> None:
    parser = AnswerParser()
    parser.feed(data)
    parser.feed(bytes(50))
    assert AnswerParser().feed(READY)


def opened() -> MultiProtocol:
    protocol = MultiProtocol()
    protocol.link_opened(0.0)
    return protocol


def write_frames(protocol: MultiProtocol, first_s: float, last_s: float) -> None:
    """Note frames every 20 ms."""
    for time_s in np.arange(first_s, last_s + 1e-9, 0.02):
        protocol.frame_written(time_s)


def test_module_is_ready_after_its_status_and_gone_after_2_s_of_silence() -> None:
    protocol = opened()
    assert not protocol.status(0.1).ready
    protocol.receive(READY, 0.5)
    assert protocol.status(0.6).ready
    assert protocol.status(2.5).ready
    silent = protocol.status(2.6)
    assert not silent.ready
    assert "module gone" in silent.text


def test_reopened_port_needs_a_new_status() -> None:
    protocol = opened()
    protocol.receive(READY, 0.5)
    protocol.receive(READY[:10], 0.5)
    protocol.link_opened(0.6)
    assert not protocol.status(0.7).ready
    protocol.receive(READY, 0.8)
    assert protocol.status(0.9).ready


def test_module_that_was_ready_for_an_earlier_process_is_ready_until_it_says_otherwise_or_falls_silent() -> (
    None
):
    protocol = MultiProtocol()
    protocol.link_resumed(0.0)
    assert protocol.status(0.0).ready
    assert protocol.status(2.0).ready
    assert "module gone" in protocol.status(2.1).text
    protocol.receive(UNKNOWN_PROTOCOL, 2.2)
    assert "refuses the protocol" in protocol.status(2.2).text
    silent = MultiProtocol(MultiSettings(answers_wired=False))
    silent.link_resumed(0.0)
    assert silent.status(0.0).ready


def test_status_that_was_made_before_the_first_frame_arrived_changes_nothing() -> None:
    protocol = MultiProtocol()
    protocol.link_resumed(0.0)
    protocol.receive(with_flags(0x46), 0.02)
    assert protocol.status(0.03).ready
    write_frames(protocol, 0.0, 0.52)
    protocol.receive(with_flags(0x46), 0.52)
    assert "receives no valid frames" in protocol.status(0.53).text


@pytest.mark.parametrize("read_s", [0.8, 0.85])
def test_module_that_received_no_frames_because_none_were_written_remains_ready(read_s: float) -> None:
    protocol = opened()
    write_frames(protocol, 0.0, 0.5)
    protocol.receive(READY, 0.5)
    write_frames(protocol, 0.81, read_s)
    protocol.receive(with_flags(0x46), read_s)
    assert protocol.status(read_s).ready
    write_frames(protocol, 0.81, 1.35)
    protocol.receive(with_flags(0x46), 1.35)
    assert not protocol.status(1.35).ready


def test_port_never_opened_is_said() -> None:
    assert MultiProtocol().status(0.0).text == "port not open"


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (UNKNOWN_PROTOCOL, "refuses the protocol"),
        (READY.replace(b"2 1F", b"--->"), "refuses the protocol"),
        (READY.replace(b"2 1F", b"----"), "refuses the protocol"),
        (with_flags(0x46), "receives no valid frames"),
        (with_flags(0x45), "not in serial mode"),
        (with_flags(0x4F), "binding"),
        (READY.replace(b"DSM", b"FRS"), "runs protocol 'FRS'"),
    ],
)
def test_module_that_is_not_ready_says_why(answer: bytes, words: str) -> None:
    protocol = opened()
    write_frames(protocol, 0.0, 0.1)
    protocol.receive(answer, 0.1)
    status = protocol.status(0.2)
    assert not status.ready
    assert words in status.text


def test_module_without_answer_line_is_ready_after_settling() -> None:
    protocol = MultiProtocol(MultiSettings(answers_wired=False))
    protocol.link_opened(0.0)
    assert not protocol.status(1.9).ready
    assert protocol.status(2.0).ready


def test_a_module_that_expects_channels_in_another_order_is_not_ready() -> None:
    order_taer = READY[:9] + bytes((0b11_00_10_01,)) + READY[10:]
    answer = order_taer.replace(b"DSM\0\0", b"E129\0")
    protocol = MultiProtocol(MultiSettings(radio="E129", sub_protocol=1))
    protocol.link_opened(0.0)
    protocol.receive(answer, 0.1)
    assert not protocol.status(0.2).ready
    assert "expects channels in the order TAER" in protocol.status(0.2).text
