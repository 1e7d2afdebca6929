"""Promises of digests of flights: they depend on what was flown, not on how it was recorded."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.records import replace

from rcopterx.flights.mcap_writing import LoggedMessage, McapFile
from rcopterx_studies.replay.digest import digest_of

FLOWN = [
    LoggedMessage(f"{vehicle}/{topic}", f"{vehicle} {topic} {number}".encode(), 1_000_000 * number, number)
    for number in range(1, 4)
    for vehicle in ("h1", "h2")
    for topic in ("pose", "plan", "command", "applied")
]


def log(path: Path, messages: list[LoggedMessage]) -> list[Path]:
    with path.open("wb") as stream:
        file = McapFile(stream)
        file.add_chunk(messages)
        file.finish()
    return [path]


@given(st.permutations(FLOWN), st.integers(0, 10**12))
def test_order_and_begin_of_the_recording_do_not_count(
    tmp_path_factory: pytest.TempPathFactory, messages: list[LoggedMessage], begin_ns: int
) -> None:
    directory = tmp_path_factory.mktemp("flights")
    later = [replace(message, time_ns=message.time_ns + begin_ns) for message in messages]
    assert digest_of(log(directory / "a", FLOWN)) == digest_of(log(directory / "b", later))


def test_every_message_counts(tmp_path: Path) -> None:
    digests = {digest_of(log(tmp_path / "all", FLOWN)).digest}
    for index, message in enumerate(FLOWN):
        changed = [*FLOWN[:index], replace(message, payload=b"another"), *FLOWN[index + 1 :]]
        digests.add(digest_of(log(tmp_path / "changed", changed)).digest)
    assert len(digests) == 1 + len(FLOWN)


def test_process_ids_and_what_follows_the_last_request_do_not_count(tmp_path: Path) -> None:
    answered = LoggedMessage("h1/answered", b"landed", 2_000_000, 1)
    status = LoggedMessage("h1/status", b"process 7", 1_000_000, 1)
    until_then = [message for message in FLOWN if message.time_ns <= answered.time_ns]
    found = digest_of(log(tmp_path / "whole", [*FLOWN, answered, status]))
    assert found == digest_of(log(tmp_path / "shorter", [*until_then, answered]))
    assert found.messages == len(until_then)
