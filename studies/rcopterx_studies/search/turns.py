"""Processes of a fleet in lockstep as greenlets of one process: one after the other takes its turn."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from greenlet import GreenletExit, getcurrent, greenlet

from rcopterx.bus import session
from rcopterx.bus.lockstep import scheduler
from rcopterx.bus.lockstep.page import ParticipantState, opened_page
from rcopterx.bus.lockstep.participant import Participant
from rcopterx.bus.lockstep.scheduler import STEP_S, Scheduler
from rcopterx.bus.processes import SIMULATOR
from rcopterx_studies.search.memory_bus import MemoryBus

Process = Callable[[], None]


class _InTurn(Participant):
    """Passes the processor on where a process of its own would wait for its pipe."""

    def _notify(self, pipe: int) -> None:
        pass

    def _notified(self, pipe: int) -> bool:  # noqa: ARG002 - no pipe is read
        getcurrent().parent.switch()
        return True

    def wait(self, timeout_s: float, descriptors: Collection[int] = ()) -> set[int]:
        """See `Participant`; also ends for a message that was delayed."""
        now_s = self.page.now()
        late_s = min((item[0] for item in self.held if item[0] > now_s), default=inf)
        return super().wait(min(timeout_s, late_s + STEP_S - now_s), descriptors)


class _InCharge(_InTurn, Scheduler):
    """Starts what is missing, and gives turns by switching to it."""

    turns: "Turns"

    def leave(self) -> None:
        """See `Participant`; the others have no pipes."""
        self._pipes.clear()
        super().leave()

    def _wait_for_participants(self) -> None:
        page = self.page
        while len(self._participants) < page.used_participants:
            self._participants.append(page.participants[len(self._participants)])
            self._pipes.append(-1)
        for index in range(1, page.used_participants):
            if self._participants[index].missing(page.time_s):
                self.turns.start(self._participants[index].name.decode())

    def _wait_until_finished(self, taking: list[int]) -> None:
        for index in taking:
            if not self.turns.resume(self._participants[index].name.decode()):
                self._note_death(index)

    def _kill(self, index: int) -> None:
        self._note_death(index)
        self.turns.end(self._participants[index].name.decode())


class Failure(NamedTuple):
    """A process that ended with an exception, and when [s]."""

    at_s: float
    process: str
    error: Exception


class Turns:
    """Processes of a fleet by name, each a function that ends with it; the simulator advances the time.

    One that ends with an exception, or is killed by a participant, is started again as in lockstep.
    """

    def __init__(self, page: Path, processes: dict[str, Process]) -> None:
        self.page, self.processes, self.bus = page, processes, MemoryBus()
        self.failures: list[Failure] = []
        self._running: dict[str, greenlet] = {}

    @contextmanager
    def in_place(self) -> Iterator[None]:
        """Let sessions that are opened meanwhile use the bus in memory, and take turns here."""
        try:
            with (
                patch.object(session, "opened", self.bus.open),
                patch.object(scheduler, "participant_of", self._participant_of),
            ):
                yield
        finally:
            for name in list(self._running):
                self.end(name)

    def _participant_of(self, page: Path, process: str, await_subscriptions: Process) -> Participant:
        kind = _InCharge if process == SIMULATOR else _InTurn
        participant = kind(opened_page(page), process, await_subscriptions)
        if isinstance(participant, _InCharge):
            participant.turns = self
        return participant

    def start(self, name: str) -> bool:
        """Start a process, until its first turn; return False if it has ended."""
        self._running[name] = greenlet(self.processes[name])
        return self.resume(name)

    def resume(self, name: str) -> bool:
        """Let a process run until it waits for its next turn; return False if it has ended."""
        running = self._running[name]
        running.parent = getcurrent()
        try:
            running.switch()
        except Exception as error:  # noqa: BLE001 - whatever ends a process, the others go on
            self.failures.append(Failure(opened_page(self.page).now(), name, error))
            self._state(name).wanted = 1
        if running.dead:
            del self._running[name]
        return not running.dead

    def end(self, name: str) -> None:
        """End a process at once, as SIGKILL does; what the system would release is released."""
        running, state = self._running[name], self._state(name)
        wanted, running.parent = state.wanted, getcurrent()
        running.throw(GreenletExit)
        state.wanted = wanted
        del self._running[name]

    def _state(self, name: str) -> ParticipantState:
        return opened_page(self.page).participant(name)
