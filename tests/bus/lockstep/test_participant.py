"""Promises of lockstep: time waits for all processes, and messages count in the same order on every run."""

import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.waiting import wait_for

from rcopterx.bus.attachments import STAMP
from rcopterx.bus.lockstep.page import (
    FIRST_S,
    LockstepPage,
    LockstepTime,
    create_page,
    opened_page,
    remove_page,
)
from rcopterx.bus.lockstep.participant import LockstepInbox, Participant, join_without_turns
from rcopterx.bus.lockstep.scheduler import RETURN_S, STEP_S, Scheduler
from rcopterx.bus.processes import SIMULATOR


class Bytes(bytes):
    """An attachment as Zenoh returns it."""

    def to_bytes(self) -> bytes:  # type: ignore[override]
        return bytes(self)


@dataclass(frozen=True)
class Sample:
    """A message that arrives."""

    key_expr: str
    stamp: bytes | None

    @property
    def attachment(self) -> Bytes | None:
        return None if self.stamp is None else Bytes(self.stamp)


def sample_of(page: LockstepPage, counter: int) -> Sample:
    """Return the newest message that a counter has counted."""
    count, owner = page.counters[counter].count, page.counters[counter].owner
    return Sample(page.counters[counter].name.decode(), STAMP.pack(count, counter, owner, page.now()))


def no_fence() -> None:
    """Subscriptions without a router."""


@dataclass
class Script:
    """A process in a thread: it waits for the times of a list, and notes when it was woken."""

    name: str
    waits_s: list[float]
    turns: Participant | None = None
    times_s: list[float] = field(default_factory=list)

    def run(self, page: LockstepPage) -> None:
        self.turns = Participant(page, self.name, no_fence)
        self.turns.begin()
        for seconds in self.waits_s:
            self.turns.wait(seconds)
            self.times_s.append(page.now() - FIRST_S)
        self.turns.leave()


@contextmanager
def page_of(directory: Path, names: list[str]) -> Iterator[LockstepPage]:
    path = directory / "lockstep"
    create_page(path, [SIMULATOR, *names])
    yield opened_page(path)
    remove_page(path)
    assert not list(directory.iterdir())


@pytest.fixture
def page(tmp_path: Path) -> Iterator[LockstepPage]:
    with page_of(tmp_path, ["a", "b"]) as found:
        yield found


def conduct(page: LockstepPage, until: Callable[[], bool], period_s: float = 0.02) -> None:
    scheduler = Scheduler(page, SIMULATOR, no_fence)
    scheduler.begin()
    while not until():
        scheduler.wait(period_s)
    scheduler.leave()


def started(*scripts: Script, page: LockstepPage) -> list[threading.Thread]:
    threads = [threading.Thread(target=script.run, args=(page,), daemon=True) for script in scripts]
    for thread in threads:
        thread.start()
    return threads


@given(st.lists(st.lists(st.integers(1, 40), max_size=8), min_size=2, max_size=2))
def test_every_process_wakes_exactly_when_its_wait_is_over(
    tmp_path_factory: pytest.TempPathFactory, waits_ms: list[list[int]]
) -> None:
    with page_of(tmp_path_factory.mktemp("page"), ["a", "b"]) as page:
        scripts = [
            Script(name, [ms / 1000 for ms in waits]) for name, waits in zip("ab", waits_ms, strict=True)
        ]
        threads = started(*scripts, page=page)
        conduct(page, lambda: not any(thread.is_alive() for thread in threads))
        for script in scripts:
            due_s = 0.0
            for wait_s, woken_s in zip(script.waits_s, script.times_s, strict=True):
                due_s += wait_s
                assert due_s <= woken_s <= due_s + STEP_S
                due_s = woken_s


def test_waiting_for_other_processes_ends_with_the_names_of_those_that_do_not_start(
    page: LockstepPage,
) -> None:
    script = Participant(page, "script", no_fence)
    join_without_turns(page.path, SIMULATOR)
    join_without_turns(page.path, "a")
    with pytest.raises(TimeoutError, match=r"missing after 0\.2 s: b$"):
        script.await_others(0.2)
    join_without_turns(page.path, "b")
    script.await_others(0.0)
    script.leave()


def test_processes_that_leave_keep_no_descriptors(page: LockstepPage) -> None:
    gc.collect()  # what earlier tests left is closed now, and not meanwhile
    held = os.listdir("/proc/self/fd")
    threads = started(Script("a", [0.01]), Script("b", [0.01]), page=page)
    conduct(page, lambda: not any(thread.is_alive() for thread in threads))
    assert os.listdir("/proc/self/fd") == held


def test_a_process_takes_no_turns_without_anything_to_do(page: LockstepPage) -> None:
    scripts = [Script("a", [0.001] * 20), Script("b", [0.5])]
    threads = started(*scripts, page=page)
    conduct(page, lambda: not threads[0].is_alive())
    took = [page.participants[page.index_of(name)].finished for name in "ab"]
    assert took[0] > took[1] + 10
    LockstepTime(page.path).want_none()
    conduct(page, lambda: not threads[1].is_alive())


def test_a_process_takes_the_turn_after_one_in_which_something_is_sent_to_it(page: LockstepPage) -> None:
    read_s: list[float] = []
    sends_s = [0.003, 0.007]

    def receive() -> None:
        turns = Participant(page, "b", no_fence)
        turns.begin()
        reception = turns.receive("key")
        receivers.append((turns, reception))
        while len(read_s) < len(sends_s):
            turns.wait(10.0)
            read_s.append(page.now() - FIRST_S)
        turns.leave()

    def wake(_: Sample) -> None:
        receivers[0][0].wake()

    def send() -> None:
        turns = Participant(page, "a", no_fence)
        turns.begin()
        for at_s in sends_s:
            turns.wait(FIRST_S + at_s - page.now())
            receivers[0][1].hold(wake, Sample("key", Bytes(turns.stamp("key"))))
        turns.wait(0.1)
        turns.leave()

    receivers: list[tuple[Participant, LockstepInbox]] = []
    threads = [threading.Thread(target=work, daemon=True) for work in (receive, send)]
    for thread in threads:
        thread.start()
    conduct(page, lambda: not any(thread.is_alive() for thread in threads), 0.001)
    assert all(sent_s < at_s <= sent_s + 2 * STEP_S for sent_s, at_s in zip(sends_s, read_s, strict=True))


def test_what_is_sent_without_waking_counts_in_the_next_turn_that_a_process_has_anyway(
    page: LockstepPage,
) -> None:
    arrived_s: list[float] = []

    def receive() -> None:
        turns = Participant(page, "b", no_fence)
        turns.begin()
        receptions.append(turns.receive("key", waking=False))
        turns.wait(0.05)
        turns.leave()

    def send() -> None:
        turns = Participant(page, "a", no_fence)
        turns.begin()
        for _ in range(3):
            turns.wait(0.003)
            sample = Sample("key", Bytes(turns.stamp("key")))
            receptions[0].hold(lambda _: arrived_s.append(page.now() - FIRST_S), sample)
        turns.wait(0.1)
        turns.leave()

    receptions: list[LockstepInbox] = []
    threads = [threading.Thread(target=work, daemon=True) for work in (receive, send)]
    for thread in threads:
        thread.start()
    conduct(page, lambda: not any(thread.is_alive() for thread in threads), 0.001)
    # All processes notice a key on which the first message is sent.
    assert len(arrived_s) == 3
    assert min(arrived_s[1:]) >= 0.05


def test_time_begins_when_all_awaited_processes_are_there(page: LockstepPage) -> None:
    first = started(Script("a", [0.01]), page=page)
    end = threading.Event()
    conducting = threading.Thread(target=conduct, args=(page, end.is_set), daemon=True)
    conducting.start()
    wait_for(lambda: page.participants[page.index_of("a")].process, "a is not there")
    assert page.now() == FIRST_S
    second = started(Script("b", [0.01]), page=page)
    for thread in (*first, *second):
        thread.join(20)
        assert not thread.is_alive()
    assert page.now() > FIRST_S
    end.set()
    conducting.join(20)


def test_time_stands_still_while_a_process_computes(page: LockstepPage) -> None:
    join_without_turns(page.path, "b")
    computing, ready = threading.Event(), threading.Event()

    def compute() -> None:
        turns = Participant(page, "a", no_fence)
        turns.begin()
        turns.wait(0.01)
        ready.set()
        computing.wait(20)
        turns.leave()

    threading.Thread(target=compute, daemon=True).start()
    end = threading.Event()
    conducting = threading.Thread(target=conduct, args=(page, end.is_set), daemon=True)
    conducting.start()
    assert ready.wait(20)
    stopped_s = page.now()
    assert not end.wait(0.3)
    assert page.now() == stopped_s
    computing.set()
    wait_for(lambda: page.now() > stopped_s, "time stands still")
    end.set()
    conducting.join(20)


@given(st.lists(st.sampled_from("ab"), max_size=8))
def test_messages_count_in_the_same_order_however_they_arrive(
    tmp_path_factory: pytest.TempPathFactory, arrivals: list[str]
) -> None:
    with page_of(tmp_path_factory.mktemp("page"), []) as page:
        scheduler = Scheduler(page, SIMULATOR, no_fence)
        scheduler.begin()
        seen: list[Sample] = []
        reception = scheduler.receive("fleet/*/pose")
        scheduler.wait(0.01)
        counters = {name: page.counter(f"fleet/{name}/pose", page.index_of(name)) for name in "ab"}
        for name in arrivals:
            page.counters[counters[name]].count += 1
            reception.hold(seen.append, sample_of(page, counters[name]))
        assert not seen
        scheduler.wait(0.01)
        keys = [sample.key_expr for sample in seen]
        assert keys == sorted(f"fleet/{name}/pose" for name in arrivals)
        for key in set(keys):
            numbers = [STAMP.unpack(sample.stamp or b"")[0] for sample in seen if sample.key_expr == key]
            assert numbers == list(range(1, len(numbers) + 1))
        scheduler.leave()


def test_a_turn_begins_when_everything_has_arrived_that_was_sent_before(page: LockstepPage) -> None:
    join_without_turns(page.path, "b")
    receiving = threading.Event()
    arrived: list[str] = []

    def receive() -> None:
        turns = Participant(page, "a", no_fence)
        turns.begin()
        reception = turns.receive("key")
        turns.wait(0.001)
        counter = page.counter("key", page.index_of("b"))
        page.counters[counter].count = 1
        late = sample_of(page, counter)

        def deliver() -> None:
            receiving.set()
            reception.hold(lambda found: arrived.append(found.key_expr), late)

        threading.Timer(0.3, deliver).start()
        turns.wait(0.001)
        assert arrived == ["key"]
        assert receiving.is_set()
        turns.leave()

    receiver = threading.Thread(target=receive, daemon=True)
    receiver.start()
    conduct(page, lambda: not receiver.is_alive())
    assert arrived == ["key"]


def test_what_was_sent_before_a_subscription_does_not_count(page: LockstepPage) -> None:
    scheduler = Scheduler(page, SIMULATOR, no_fence)
    scheduler.begin()
    join_without_turns(page.path, "a")
    join_without_turns(page.path, "b")
    counter = page.counter("key", page.index_of("a"))
    page.counters[counter].count = 7
    scheduler.receive("key")
    scheduler.wait(0.01)
    scheduler.wait(0.01)


PLAYER = """
import sys
from pathlib import Path
from rcopterx.bus.lockstep.page import opened_page
from rcopterx.bus.lockstep.participant import Participant
turns = Participant(opened_page(Path(sys.argv[1])), "a", lambda: None)
turns.begin()
while True:
    turns.wait(0.05)
"""


def test_a_killed_process_stops_the_time_only_from_the_turn_of_its_successor_on(page: LockstepPage) -> None:
    join_without_turns(page.path, "b")
    end = threading.Event()
    conducting = threading.Thread(target=conduct, args=(page, end.is_set), daemon=True)
    conducting.start()
    command = [sys.executable, "-c", PLAYER, str(page.path)]
    with subprocess.Popen(command) as first:
        wait_for(lambda: page.now() > FIRST_S + 1.0, "no time passes")
        participant = page.participants[page.index_of("a")]
        participant.to_be_killed = 1
        assert first.wait(20) == -signal.SIGKILL
        wait_for(
            lambda: participant.return_s > 0 and page.now() >= participant.return_s, "time waits too early"
        )
        stopped_s = page.now()
        assert stopped_s <= participant.return_s + 0.021
        assert LockstepTime(page.path).lived_s("a") >= 1.0
        assert LockstepTime(page.path).lived_s("a") == 0.0
        with subprocess.Popen(command) as second:
            wait_for(lambda: page.now() > stopped_s + 2 * RETURN_S, "time does not continue")
            second.kill()
            second.wait(20)
            LockstepTime(page.path).want_none()
            end.set()
            conducting.join(20)
            assert not conducting.is_alive()
