"""Shared memory of a fleet in lockstep: its time, its processes, and how much each of them has sent.

Counters show a receiver how much must arrive before its next turn. Every field has one writer at a time, or
several that write the same: the number of the present turn.
"""

import ctypes
import fcntl
import mmap
import os
from collections.abc import Iterable
from ctypes import c_char, c_double, c_int64, c_uint8, c_uint64
from functools import cache
from pathlib import Path
from typing import Final

FIRST_S: Final = 1000.0  # time of a fleet at its start
PROCESSES: Final = 512
COUNTERS: Final = 16_384


class ParticipantState(ctypes.Structure):
    """A process that takes turns."""

    _fields_ = (
        ("name", c_char * 64),
        ("process", c_uint64),  # its id, 0 for none
        ("wanted", c_uint64),  # whether time waits for it while it is missing
        ("to_be_killed", c_uint64),  # whether the scheduler kills it
        ("finished", c_uint64),  # its last turn
        ("due_s", c_double),  # when it has something to do
        ("called", c_uint64),  # whether it has something to do in the next turn
        ("listens", c_uint64),  # whether it waits for bytes
        ("mail_turn", c_uint64),  # last turn in which something was sent to it
        ("return_s", c_double),  # when it takes turns again
        ("began_s", c_double),  # when it took its first turn
        ("lived_s", c_double),  # for how long the last one that died took turns
        ("reads", c_uint8 * (COUNTERS // 8)),  # a bit for every counter: whether it receives what is counted
    )

    def missing(self, time_s: float) -> bool:
        """Return whether the time of the fleet waits for the process."""
        return bool(self.wanted and not self.process and self.return_s <= time_s)


class SentCounter(ctypes.Structure):
    """How much the process at index `owner` has sent under a name."""

    _fields_ = (("name", c_char * 112), ("owner", c_int64), ("count", c_uint64))


class LockstepPage(ctypes.Structure):
    """The page of a fleet."""

    _fields_ = (
        ("time_s", c_double),
        ("turn", c_uint64),
        ("sent_turn", c_uint64),  # last turn in which anything was sent
        ("reading_turn", c_uint64),  # last turn in which a process began to receive
        ("counter_turn", c_uint64),  # last turn in which a counter was added
        ("used_participants", c_uint64),
        ("used_counters", c_uint64),
        ("lost_routers", c_uint64),  # how often the router has died
        ("participants", ParticipantState * PROCESSES),
        ("counters", SentCounter * COUNTERS),
    )
    path: Path
    used_participants: int
    used_counters: int

    def now(self) -> float:
        """Return the time of the fleet [s]."""
        return float(self.time_s)

    def index_of(self, name: str) -> int:
        """Return the index of a process, which is added if missing."""
        with self.path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            for index in range(self.used_participants):
                if self.participants[index].name == name.encode():
                    return index
            index = int(self.used_participants)
            self.participants[index].name = name.encode()
            os.mkfifo(self.pipe(index), 0o600)
            self.used_participants = index + 1
            return index

    def participant(self, name: str) -> ParticipantState:
        """Return a process, which is added if missing."""
        found: ParticipantState = self.participants[self.index_of(name)]
        return found

    def pipe(self, index: int) -> Path:
        """Return the pipe that wakes a process."""
        return self.path.with_name(f"{self.path.name}.{index}")

    def counter(self, name: str, owner: int) -> int:
        """Return the index of a new counter of a process."""
        with self.path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            index = int(self.used_counters)
            self.counters[index].name, self.counters[index].owner = name.encode(), owner
            self.used_counters, self.counter_turn = index + 1, self.turn
            return index

    def counts(self, name: str) -> bool:
        """Return whether a process that is there has sent anything under a name."""
        counters = self.counters[: self.used_counters]
        return any(counter.count and counter.name == name.encode() for counter in counters)

    def release(self, index: int) -> None:
        """Note that a process is gone: no process waits for what it has sent."""
        for counter in self.counters[: self.used_counters]:
            if counter.owner == index:
                counter.count = 0
        self.participants[index].process = 0


@cache
def opened_page(path: Path) -> LockstepPage:
    """Map the page of a fleet, once per process; raises `OSError` if the fleet is not up in lockstep."""
    with path.open("r+b") as file:
        page = LockstepPage.from_buffer(mmap.mmap(file.fileno(), ctypes.sizeof(LockstepPage)))
    page.path = path
    return page


def create_page(path: Path, names: Iterable[str]) -> None:
    """Create the page of a fleet, whose time begins when all processes with these names are there."""
    remove_page(path)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    # Without memory behind it, writing to the page would end the process.
    os.posix_fallocate(descriptor, 0, ctypes.sizeof(LockstepPage))
    os.close(descriptor)
    opened_page.cache_clear()
    page = opened_page(path)
    page.time_s, page.turn = FIRST_S, 1
    for name in names:
        page.participant(name).wanted = 1


def remove_page(path: Path) -> None:
    """Remove the page of a fleet that is down."""
    for found in path.parent.glob(f"{path.name}*"):
        found.unlink()


class LockstepTime:
    """Launchers' side of the time of a fleet, on a page from `begin` to `end`; it waits for every process."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def begin(self, processes: Iterable[str]) -> None:
        """Begin when all these processes are there."""
        create_page(self._path, processes)

    def lived_s(self, process: str) -> float:
        """Return, once, for how long a process that has died took turns [s]; 0 if it never did."""
        participant = opened_page(self._path).participant(process)
        lived_s, participant.lived_s = float(participant.lived_s), 0.0
        return lived_s

    def want(self, process: str, wanted: bool) -> None:
        """Wait for a process that is started, or end one at the present time."""
        participant = opened_page(self._path).participant(process)
        participant.wanted, participant.to_be_killed = wanted, not wanted and participant.process > 0

    def want_none(self) -> None:
        """Pass without processes that are missing."""
        page = opened_page(self._path)
        for participant in page.participants[1 : page.used_participants]:
            participant.wanted = 0

    def note_lost_routers(self, count: int) -> None:
        """Pass without the messages that were lost with so many routers."""
        opened_page(self._path).lost_routers = count

    def end(self) -> None:
        """End; the processes have ended."""
        remove_page(self._path)
