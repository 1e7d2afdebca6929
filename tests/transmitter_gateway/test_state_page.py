"""Promises of the page in which a gateway leaves the state of a vehicle to its successor."""

import errno
import math
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.transmitter_gateway.inputs import LastApplied, State, Track
from rcopterx.transmitter_gateway.state_page import (
    NOT_FLYING,
    PAGE_BYTES,
    SLOT_BYTES,
    StatePage,
    begin_page,
    decode,
    encode,
    open_page,
    page_of_process,
)

BOOT = b"since this morning"
STICK = st.floats(-1, 1)
NUMBER = st.floats(allow_nan=False)
COUNT = st.integers(0, 2**64 - 1)
PLACE = st.tuples(NUMBER, NUMBER, NUMBER)
TRACKS = st.builds(
    Track,
    epoch=COUNT,
    frame=COUNT,
    arrived_s=NUMBER,
    position_m=st.none() | PLACE,
    seen_s=NUMBER,
    seen_frame=COUNT,
    seen_epoch=COUNT,
    velocity_m_s=PLACE,
    yaw_rad=st.none() | NUMBER,
    turned_s=st.none() | NUMBER,
    captured_s=NUMBER,
    occluded=st.booleans(),
    undelivered_s=NUMBER,
)
LASTS = st.builds(
    LastApplied,
    state=st.sampled_from(State),
    u=st.tuples(STICK, STICK, STICK, STICK),
    written_s=st.floats(allow_nan=False),
    lease=st.integers(0, 2**64 - 1),
    issued=st.integers(0, 2**64 - 1),
    hover_thrust=st.floats(0, 1),
    commanded=st.booleans(),
    mistaken=st.booleans(),
    ready=st.booleans(),
    track=st.none() | TRACKS,
)
FLYING = LastApplied(State.HOLD, (0.1, -0.2, 0.5, 0.05), 12.5, 7, 9, 0.61, commanded=True, ready=True)


def page(memory: bytearray) -> StatePage:
    return StatePage(memory, BOOT)


@given(last=LASTS, number=st.integers(0, 2**64 - 1))
def test_a_record_returns_what_was_written(last: LastApplied, number: int) -> None:
    record = encode(number, last, BOOT)
    assert decode(record, BOOT) == (number, last)
    assert len(record) < SLOT_BYTES


@given(last=LASTS, at=st.integers(0), bit=st.integers(0, 7))
def test_a_record_with_a_wrong_bit_is_invalid(last: LastApplied, at: int, bit: int) -> None:
    record = bytearray(encode(1, last, BOOT))
    record[at % len(record)] ^= 1 << bit
    assert decode(bytes(record), BOOT) is None


@given(slot=st.binary(max_size=2 * SLOT_BYTES))
def test_whatever_is_in_a_page_is_read_without_error(slot: bytes) -> None:
    assert decode(slot, BOOT) is None


def test_an_empty_page_differs_from_one_of_a_vehicle_that_does_not_fly() -> None:
    memory = bytearray(PAGE_BYTES)
    assert page(memory).last is None
    page(memory).save(NOT_FLYING)
    assert page(memory).last == NOT_FLYING
    assert NOT_FLYING.written_s == -math.inf


@given(lasts=st.lists(LASTS, min_size=1, max_size=5))
def test_the_newest_record_counts_also_over_restarts(lasts: list[LastApplied]) -> None:
    memory = bytearray(PAGE_BYTES)
    for last in lasts:
        page(memory).save(last)
    assert page(memory).last == lasts[-1]


@given(lasts=st.lists(LASTS, min_size=2, max_size=5), kept=st.integers(0, SLOT_BYTES - 1))
def test_a_process_that_dies_while_it_writes_leaves_the_record_before(
    lasts: list[LastApplied], kept: int
) -> None:
    memory = bytearray(PAGE_BYTES)
    writer = page(memory)
    for last in lasts[:-1]:
        writer.save(last)
    before = bytes(memory)
    writer.save(lasts[-1])
    whole = bytes(memory)
    start = next(at for at in (0, SLOT_BYTES) if whole[at : at + SLOT_BYTES] != before[at : at + SLOT_BYTES])
    memory[start + kept :] = before[start + kept :]
    assert page(memory).last in (lasts[-2], lasts[-1])
    assert page(memory).last is not None


def test_a_record_from_before_the_computer_was_started_again_is_invalid() -> None:
    memory = bytearray(PAGE_BYTES)
    page(memory).save(FLYING)
    assert StatePage(memory, b"since the afternoon").last is None


def test_a_page_is_private_and_outlives_its_process(tmp_path: Path) -> None:
    path = tmp_path / "states" / "h1"
    first = open_page(path)
    assert first.last is None
    first.save(FLYING)
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    first.close()
    second = open_page(path)
    assert second.last == FLYING
    second.close()


def test_a_page_has_one_process(tmp_path: Path) -> None:
    first = open_page(tmp_path / "states" / "h1")
    with pytest.raises(BlockingIOError):
        open_page(tmp_path / "states" / "h1")
    first.close()
    open_page(tmp_path / "states" / "h1").close()


def test_a_page_that_others_could_write_is_refused(tmp_path: Path) -> None:
    states = tmp_path / "states"
    open_page(states / "h1").close()
    (states / "h1").chmod(0o666)
    with pytest.raises(PermissionError, match="is not private to this user") as refused:
        open_page(states / "h1")
    assert (refused.value.errno, refused.value.filename) == (errno.EPERM, str(states / "h1"))
    states.chmod(0o777)
    with pytest.raises(PermissionError, match="not private") as refused:
        open_page(states / "h2")
    assert refused.value.filename == str(states)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "states").mkdir(0o700)
    os.mkfifo(tmp_path / "states" / "h1", 0o600)
    with pytest.raises(PermissionError, match="not private"):
        open_page(tmp_path / "states" / "h1")


def test_a_process_without_a_page_keeps_its_own() -> None:
    own = page_of_process()
    assert own.last is None
    own.save(FLYING)
    assert own.last == FLYING
    own.close()


def test_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "states").mkdir(0o700)
    (tmp_path / "elsewhere").write_bytes(bytes(PAGE_BYTES))
    (tmp_path / "elsewhere").chmod(0o600)
    os.symlink(tmp_path / "elsewhere", tmp_path / "states" / "h1")
    with pytest.raises(OSError, match="h1"):
        open_page(tmp_path / "states" / "h1")
    os.symlink(tmp_path / "states", tmp_path / "link")
    with pytest.raises(PermissionError, match="not private"):
        open_page(tmp_path / "link" / "h2")


def test_a_new_page_says_that_its_vehicle_does_not_fly_and_a_valid_one_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "states" / "h1"
    begin_page(path).close()
    first = open_page(path)
    assert first.last == NOT_FLYING
    first.save(FLYING)
    first.close()
    begin_page(path).close()
    second = open_page(path)
    assert second.last == FLYING
    second.close()
