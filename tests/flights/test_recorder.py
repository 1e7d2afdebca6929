"""Promises of the recorder: all of the bus, losses counted, memory flat, and a kill costs one chunk."""

import signal
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
from support.bus import Child, raw_put
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.messages import Kill, Pose
from rcopterx.bus.session import BusAddress, RawMessage, Session
from rcopterx.flights.flight_writing import FlightSettings, FlightWriter
from rcopterx.flights.flights import flights_in
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import LoggedMessage
from rcopterx.flights.recorder import (
    NANO,
    Gaps,
    Recorder,
    RecorderSettings,
    Waiting,
    run_recorder,
)

Join = Callable[..., Session]
FLIGHT = "lab-20261122-141500"

RECORDER_CODE = """
import sys
from pathlib import Path
from rcopterx.bus.session import BusAddress
from rcopterx.flights.flight_writing import FlightSettings
from rcopterx.flights.recorder import RecorderSettings, run_recorder
endpoint, fleet, namespace, directory = sys.argv[1:]
flight = FlightSettings(Path(directory), "lab-20261122-141500", {}, b"{}", 10**9, 10**9)
bus = BusAddress((endpoint,), fleet, namespace)
print("ready", flush=True)
run_recorder(RecorderSettings(bus, "main", lambda: flight, 0), print)
"""


def pose(frame: int) -> Pose:
    return Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=True)


def raw(number: int, arrived_s: float = 0.0, size: int = 10) -> RawMessage:
    return RawMessage("h1", "pose", bytes(size), arrived_s, number)


def recorded(directory: Path) -> list[LoggedMessage]:
    return [m for flight in flights_in(directory) for path in flight.parts for m in messages_of(path)]


def recorder(directory: Path, waiting: Waiting, wall_ns: int = 0) -> Recorder:
    flight = FlightSettings(directory, FLIGHT, {}, b"{}", 10**9, 10**9)
    return Recorder(waiting, FlightWriter(flight), wall_ns)


@pytest.fixture
def process(bus_address: BusAddress, tmp_path: Path) -> Child:
    arguments = (bus_address.endpoints[0], bus_address.fleet, str(bus_address.namespace), str(tmp_path))
    return Child(RECORDER_CODE, *arguments)


def test_a_killed_recorder_leaves_everything_that_is_older_than_its_last_chunk(
    process: Child, join: Join, bus_address: BusAddress, tmp_path: Path
) -> None:
    sender = join()
    frames = iter(range(1, 10_000))

    def on_disk(topic: str) -> list[LoggedMessage]:
        sender.publish(channels.POSE, "h1", pose(next(frames)))
        raw_put(
            bus_address,
            channels.key("all", "fleet", "kill"),
            msgspec.msgpack.encode(Kill(source="x", reason="y")),
        )
        with suppress(FlightLogError):  # a file that is being created is empty
            return [m for m in recorded(tmp_path) if m.topic == topic]
        return []

    try:
        wait_for(lambda: len(on_disk("h1/pose")) >= 3 and on_disk("fleet/kill"), "nothing is recorded")
        before = recorded(tmp_path)
    finally:
        process.end(signal.SIGKILL)
    after = recorded(tmp_path)
    assert after[: len(before)] == before
    numbers = [m.number for m in after if m.topic == "h1/pose"]
    assert numbers == sorted(set(numbers))


def test_the_recorder_listens_before_it_prepares_its_flight_log(monkeypatch: pytest.MonkeyPatch) -> None:
    taps: list[tuple[str, ...]] = []

    class Listening:
        def __enter__(self) -> "Listening":
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def tap(self, _store: object, *words: str) -> None:
            taps.append(words)

        def take_no_turns(self, _process: str) -> None: ...

    class PreparedError(Exception):
        pass

    def prepare() -> FlightSettings:
        raise PreparedError

    monkeypatch.setattr("rcopterx.flights.recorder.Session", lambda _: Listening())
    monkeypatch.setattr("rcopterx.flights.recorder.ending_signals", list)
    with pytest.raises(PreparedError):
        run_recorder(RecorderSettings(BusAddress((), "lab", ""), "main", prepare, 0), print)
    assert taps == [(), (channels.KILL.topic, channels.EVERY_FLEET)]


def test_a_recorder_completes_its_file_on_sigterm_and_publishes_its_state(
    process: Child, join: Join, tmp_path: Path
) -> None:
    listener = join()
    statuses = listener.subscribe(channels.RECORDER, "main")

    def published() -> RecorderStatus | None:
        listener.publish(channels.POSE, "h1", pose(1))
        received = statuses.latest()
        return None if received is None or not received.message.messages else received.message

    try:
        wait_for(lambda: published() is not None, "the recorder does not publish its state")
        status = published()
    finally:
        code = process.end(signal.SIGTERM)
    assert code == 0
    assert status is not None
    assert (status.state, status.reason) == ("recording", "")
    assert status.file == str(flights_in(tmp_path)[0].parts[0])


def test_counters_of_senders_show_what_was_lost() -> None:
    gaps = Gaps()
    for topic, number in (
        ("a", 1),
        ("b", 7),
        ("a", 2),
        ("a", 5),
        ("b", 8),
        ("a", 1),
        ("a", 2),
        ("c", 0),
        ("c", 0),
    ):
        gaps.note(topic, number)
    assert gaps.lost == 2


def test_times_are_those_of_the_monotonic_clock_whatever_the_wall_clock_does(tmp_path: Path) -> None:
    waiting = Waiting()
    log = recorder(tmp_path, waiting, wall_ns=1_000 * NANO)
    for number, arrived_s in ((1, 5.0), (2, 5.25)):
        waiting.store(raw(number, arrived_s))
    log.flush()
    times_ns = [message.time_ns for message in recorded(tmp_path)]
    assert times_ns == pytest.approx([1_005 * NANO, 1_005 * NANO + NANO // 4], abs=1023, rel=0)


def test_channels_that_are_not_of_the_table_are_not_recorded(tmp_path: Path) -> None:
    waiting = Waiting()
    log = recorder(tmp_path, waiting)
    waiting.store(RawMessage("h1", "gossip", b"x", 0.0, 1))
    waiting.store(raw(1))
    log.flush()
    assert [m.topic for m in recorded(tmp_path)] == ["h1/pose"]
    assert log.status().messages == 1


def test_a_slow_disk_loses_messages_that_are_counted_and_never_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.flights.recorder.MAX_WAITING_BYTES", 1000)
    waiting = Waiting()
    log = recorder(tmp_path, waiting)
    for number in range(1, 41):
        waiting.store(raw(number, size=100))
    log.flush()
    assert log.status().lost == waiting.dropped == 29
    waiting.store(raw(41))
    log.flush()
    assert recorded(tmp_path)[-1].number == 41


def test_memory_stays_flat_over_many_messages(tmp_path: Path) -> None:
    waiting = Waiting()
    log = recorder(tmp_path, waiting)

    def flown(count: int) -> int:
        for first in range(0, count, 50):
            for number in range(50):
                waiting.store(raw(first + number, size=300))
            log.flush()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        settled = flown(5_000)
        assert flown(20_000) < settled + 200_000
    finally:
        tracemalloc.stop()
