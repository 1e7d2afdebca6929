"""Promises of digests of flights: they depend on what was flown, not on how it was recorded."""

from hypothesis import given
from hypothesis import strategies as st
from support.records import replace

from rcopterx.flights.mcap_writing import LoggedMessage
from rcopterx_studies.replay.digest import digest_of

FLOWN = [
    LoggedMessage(f"{vehicle}/{topic}", f"{vehicle} {topic} {number}".encode(), 1_000_000 * number, number)
    for number in range(1, 4)
    for vehicle in ("h1", "h2")
    for topic in ("pose", "plan", "command", "applied")
]


@given(st.permutations(FLOWN), st.integers(0, 10**12))
def test_order_and_begin_of_the_recording_do_not_count(messages: list[LoggedMessage], begin_ns: int) -> None:
    later = [replace(message, time_ns=message.time_ns + begin_ns) for message in messages]
    assert digest_of(FLOWN) == digest_of(later)


def test_every_message_counts() -> None:
    digests = {digest_of(FLOWN).digest}
    for index, message in enumerate(FLOWN):
        changed = [*FLOWN[:index], replace(message, payload=b"another"), *FLOWN[index + 1 :]]
        digests.add(digest_of(changed).digest)
    assert len(digests) == 1 + len(FLOWN)


def test_process_ids_and_what_follows_the_last_request_do_not_count() -> None:
    answered = LoggedMessage("h1/answered", b"landed", 2_000_000, 1)
    status = LoggedMessage("h1/status", b"process 7", 1_000_000, 1)
    until_then = [message for message in FLOWN if message.time_ns <= answered.time_ns]
    found = digest_of([*FLOWN, answered, status])
    assert found == digest_of([*until_then, answered])
    assert found.messages == len(until_then)
