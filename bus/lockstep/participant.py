"""A process of a fleet in lockstep, which takes turns: the time stands still until all of them have finished.

In a turn at time t a process uses exactly what was sent before t, in the order of time of sending, key, and
number on the key. So nothing depends on how long a process computes, or a message travels.
"""

import os
import select
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial
from itertools import count
from math import inf
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.attachments import STAMP, attached
from rcopterx.bus.endpoints import LONG_S
from rcopterx.bus.lockstep.page import LockstepPage, ParticipantState, SentCounter, opened_page
from rcopterx.bus.processes import SCRIPT, SERVICES

POLL_S: Final = 0.1  # real time between two checks for what wakes no process
Held = tuple[float, str, int, int, Callable[[], object]]
"""What has arrived: time of sending [s], key, number, number of the inbox; delivers it in its turn."""
LOST_S: Final = 1.0  # real time after which messages are lost, once a router has died with some of them
NOT_STARTED_AGAIN: Final = frozenset(name.encode() for name in (SCRIPT, *SERVICES))


class Participant:
    """The turns of this process, or of one of its threads; the first one has begun when `begin` returns."""

    def __init__(
        self,
        page: LockstepPage,
        name: str,  # of the process
        await_subscriptions: Callable[[], None],  # returns when the router knows all subscriptions
    ) -> None:
        self.page, self.index = page, page.index_of(name)
        self._own, self._await_subscriptions = page.participants[self.index], await_subscriptions
        self._pipe, self._scheduler = (
            os.open(page.pipe(index), os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC) for index in (self.index, 0)
        )
        self.arrived = threading.Event()
        self.interrupted: Callable[[], bool] = lambda: False  # whether to end instead of waiting for a turn
        self.before_wait: Callable[[], None] = lambda: None  # called when a loop begins to wait
        self.held: deque[Held] = deque()
        self._counters: dict[str, tuple[int, SentCounter]] = {}
        # By counter, with the turn that they are of.
        self._readers: dict[int, tuple[int, list[ParticipantState]]] = {}
        self._woken = False
        self._numbers = count()
        self._inboxes: list[LockstepInbox] = []
        self._new_inboxes: list[LockstepInbox] = []  # of which the router may not have taken notice yet
        self._found = 0
        self._replies = self.receive(f"reply {self.index}")  # to requests of this process
        self._taken = 0

    def begin(self) -> None:
        """Take the first turn, once no process is missing."""
        self._taken = self.page.turn - 1
        with suppress(BlockingIOError):
            os.read(self._pipe, 4096)
        self._own.due_s = -inf
        self._own.process = os.getpid()
        self._take_turn()
        self._own.began_s = self.page.time_s
        self._own.wanted = self._own.name not in NOT_STARTED_AGAIN

    def await_others(self, limit_s: float) -> None:
        """Wait before `begin` for other processes; `TimeoutError` if some are missing after a real time."""
        give_up_s = time.monotonic() + limit_s
        while missing := self._others_missing():
            if time.monotonic() >= give_up_s:
                raise TimeoutError(f"missing after {limit_s:g} s: {', '.join(missing)}")
            time.sleep(POLL_S)

    def _others_missing(self) -> list[str]:
        page = self.page
        others = [page.participants[index] for index in range(page.used_participants) if index != self.index]
        return [participant.name.decode() for participant in others if participant.missing(page.time_s)]

    def leave(self) -> None:
        """Take no further turns, and release the pipes."""
        self._own.wanted = 0
        self.page.release(self.index)
        self._notify(self._scheduler)
        for pipe in (self._pipe, self._scheduler):
            os.close(pipe)

    def stamp(self, key: str) -> bytes:
        """Count what is about to be sent on a key, and return its attachment."""
        page = self.page
        if key not in self._counters:
            added = page.counter(key, self.index)
            self._counters[key] = added, page.counters[added]
        index, counter = self._counters[key]
        counter.count += 1
        page.sent_turn = turn = page.turn
        for participant in self._readers_of(index):
            participant.mail_turn = turn
        return STAMP.pack(counter.count, index, self.index, page.time_s)

    def _readers_of(self, counter: int) -> list[ParticipantState]:
        """Return the processes that have begun before this turn to receive what is counted."""
        turn, readers = self._readers.get(counter, (0, []))
        if turn <= self.page.reading_turn:
            participants = self.page.participants[: self.page.used_participants]
            readers = [each for each in participants if each.reads[counter >> 3] >> (counter & 7) & 1]
            self._readers[counter] = self.page.turn, readers
        return readers

    def read(self, counter: int) -> None:
        """Take a turn after each in which something is counted, from the next one on."""
        self._own.reads[counter >> 3] |= 1 << (counter & 7)
        self._own.mail_turn = self.page.reading_turn = self.page.turn

    def reply_stamp(self, request: bytes) -> bytes | None:
        """Return the attachment of the reply to a request with this attachment."""
        return self.stamp(f"reply {STAMP.unpack(request)[2]}") if len(request) == STAMP.size else None

    def receive(self, key: str, *, waking: bool = True) -> "LockstepInbox":
        """Wait from now on for what is sent on a key, in which `*` is any unit.

        What is sent on a `waking` one gives this process a turn; the rest counts in its next one.
        """
        inbox = LockstepInbox(self, next(self._numbers), key, waking=waking)
        self._new_inboxes.append(inbox)
        return inbox

    def end(self, inbox: "LockstepInbox") -> None:
        """Wait no longer for what is sent on a key."""
        for inboxes in (self._inboxes, self._new_inboxes):
            with suppress(ValueError):
                inboxes.remove(inbox)

    def serve(self, key: str) -> "LockstepInbox":
        """Answer requests on a key from now on."""
        self.stamp(f"serve {key}")
        return self.receive(key)

    def serves(self, key: str) -> bool:
        """Return whether a process that takes turns answers requests on a key."""
        return self.page.counts(f"serve {key}")

    def request(self, send: Callable[..., object], key: str, timeout_s: float) -> list[zenoh.Reply]:
        """Take turns until the reply to a request on a key counts; none after the time-out [s].

        `send` sends it with an attachment, and passes the reply to a callback.
        """
        replies: list[zenoh.Reply] = []

        def answered(reply: zenoh.Reply, _: zenoh.Sample | None = None) -> None:
            replies.append(reply)
            self.wake()

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is None:
                answered(reply)
            else:
                self._replies.hold(partial(answered, reply), reply.ok)

        send(Callback(on_reply, indirect=False), attachment=self.stamp(key), timeout=LONG_S)
        give_up_s = self.page.now() + timeout_s
        while not replies and self.page.now() < give_up_s:
            self.wait(give_up_s - self.page.now())
        return replies

    def kill(self, name: str) -> None:
        """Let the scheduler kill a process after the next turn; time waits for its successor after 0.3 s."""
        self.page.participant(name).to_be_killed = 1

    def stop(self, name: str, seconds: float) -> None:
        """Let a process take no turns for a time, as if it were stopped."""
        participant = self.page.participant(name)
        participant.return_s, participant.called = self.page.now() + seconds, 1

    def call(self) -> None:
        """Take the next turn, whenever it is; any thread may call this."""
        self._own.called = 1

    def wake(self) -> None:
        """End the present wait with its next turn, else the next one; any thread may call this."""
        self._woken = True
        self.call()

    def wait(self, timeout_s: float, descriptors: Collection[int] = ()) -> set[int]:
        """Finish the turn, and take others until a message, data or time-out [s]; return what is readable.

        What the scheduler has written to a pseudo-terminal or a socket before a turn can be read in it.
        """
        due_s = self.page.now() + timeout_s
        self._own.due_s, self._own.listens = -inf if self._woken else due_s, len(descriptors)
        self._join()
        while True:
            there = self._take_turn()
            readable = select.select(descriptors, [], [], 0)[0]
            if readable or self._woken or not there or self.page.now() >= due_s:
                self._woken = False
                return set(readable)

    def _join(self) -> None:
        """Wait until new subscriptions receive all that is sent after this turn."""
        if not self._new_inboxes:
            return
        self._await_subscriptions()
        for inbox in self._new_inboxes:
            for index in range(self.page.used_counters):
                inbox.await_counter(index, self.page.counters[index], beyond=True)
        self._inboxes += self._new_inboxes
        self._new_inboxes.clear()

    def _take_turn(self) -> bool:
        """Finish the turn and wait for the next one; return False if there is none."""
        self._own.finished = self._taken
        self._notify(self._scheduler)
        while not (self._notified(self._pipe) and self.page.turn != self._taken):
            if self.interrupted() or not self.page.participants[0].wanted:
                return False
        self._taken, self._own.called = self.page.turn, 0
        self._collect()
        return True

    def _collect(self) -> None:
        """Wait until everything has arrived that was sent before this turn, and deliver it in order."""
        end = self.page.used_counters
        for index in range(self._found, end):
            for inbox in self._inboxes:
                inbox.await_counter(index, self.page.counters[index], beyond=False)
        self._found, give_up_s = end, time.monotonic() + LOST_S
        for inbox in self._inboxes:
            inbox.await_all(give_up_s)
        now_s, held = self.page.time_s, [self.held.popleft() for _ in range(len(self.held))]
        self.held.extendleft(item for item in held if item[0] >= now_s)
        for *_, deliver in sorted((item for item in held if item[0] < now_s), key=itemgetter(0, 1, 2, 3)):
            deliver()

    def _notify(self, pipe: int) -> None:
        with suppress(BlockingIOError):
            os.write(pipe, b".")

    def _notified(self, pipe: int) -> bool:
        """Wait until there is something in a pipe, and read it; return False if there is not for a while."""
        notified = bool(select.select([pipe], [], [], POLL_S)[0])
        if notified:
            os.read(pipe, 4096)
        return notified


class LockstepInbox:
    """What a process receives under a key, in which `*` is any unit; a `waking` one gives it turns."""

    def __init__(self, owner: Participant, number: int, key: str, *, waking: bool) -> None:
        self._owner, self._number, self._since_s = owner, number, owner.page.now()
        self._waking = waking
        self._key = zenoh.KeyExpr(key)
        self._received: dict[int, int] = {}
        self._counters: dict[int, SentCounter] = {}
        self._awaited = -1  # index of the counter that this process waits for

    def hold(self, on_arrival: Callable[[Any], object], arrived: Any) -> None:
        """Keep a sample or query for its turn, the next one if its sender takes no turns; any thread."""
        attachment, key = attached(arrived.attachment), str(arrived.key_expr)
        stamped = len(attachment) == STAMP.size
        number, counter, _, sent_s = STAMP.unpack(attachment) if stamped else (0, -1, 0, -inf)
        if not -inf < sent_s <= self._since_s:
            self._owner.held.append((sent_s, key, number, self._number, partial(on_arrival, arrived)))
        self._received[counter] = number
        if counter == self._awaited:
            self._owner.arrived.set()
        if not stamped:
            self._owner.call()

    def await_counter(self, index: int, counter: SentCounter, *, beyond: bool) -> None:
        """Wait for what another process sends, only beyond what it has sent if so requested."""
        if counter.owner != self._owner.index and self._key.includes(counter.name.decode()):
            self._received.setdefault(index, counter.count if beyond else 0)
            self._counters[index] = counter
            if self._waking:
                self._owner.read(index)

    def await_all(self, give_up_s: float) -> None:
        """Wait until everything has arrived that was sent, or a router has lost it; real time."""
        # The newest first: when it is there, most of the others are.
        for index, counter in reversed(self._counters.items()):
            self._awaited = index
            while self._received[index] < counter.count:
                if self._owner.page.lost_routers and time.monotonic() > give_up_s:
                    self._received[index] = counter.count
                else:
                    self._owner.arrived.wait(POLL_S)
                    self._owner.arrived.clear()

    def end(self) -> None:
        """Receive no more."""
        self._owner.end(self)


def join_without_turns(path: Path, name: str) -> None:
    """Enter a process that takes no turns, so that the time of the fleet need not wait for it."""
    page = opened_page(path)
    participant = page.participant(name)
    participant.return_s = inf
    participant.process = os.getpid()
