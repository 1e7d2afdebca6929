"""The scheduler of a fleet in lockstep: the simulated laboratory, which advances the time."""

import os
import select
import signal
from collections.abc import Callable, Collection
from contextlib import suppress
from math import ceil
from pathlib import Path
from typing import Final

from rcopterx.bus.lockstep.page import ParticipantState, opened_page
from rcopterx.bus.lockstep.participant import Participant
from rcopterx.bus.processes import SIMULATOR
from rcopterx.bus.rounding import TIME_BITS

STEP_S: Final = 2.0**-11  # least time between two turns; so long messages travel
RETURN_S: Final = 0.3  # time from the death of a process to the first turn of its successor
_TICKS: Final = 2.0**TIME_BITS


class Scheduler(Participant):
    """Participant of the process that advances the time.

    It takes its own turn first, and then those others theirs that have something to do. The next one follows
    after `STEP_S` if anything was sent, else when a process has something to do. A process that dies is
    replaced after `RETURN_S`: then time stands still until its successor is there.
    """

    def begin(self) -> None:
        """Begin a turn, which no process takes yet."""
        self._pipes: list[int] = []
        self._participants: list[ParticipantState] = []
        self._own.wanted, self._own.process = 1, os.getpid()
        # A predecessor may have died during a turn.
        self.page.turn += 1

    def wait(self, timeout_s: float, descriptors: Collection[int] = ()) -> set[int]:
        """See `Participant`; processes that wait for bytes take the present turn: some may be there."""
        self._acted = True
        return super().wait(timeout_s, descriptors)

    def leave(self) -> None:
        """See `Participant`."""
        super().leave()
        for pipe in self._pipes:
            os.close(pipe)

    def _take_turn(self) -> bool:
        """Let the others take the present turn, and begin the next one."""
        page, now_s = self.page, self.page.now()
        self._wait_for_participants()
        participants = self._participants
        there = [index for index, participant in enumerate(participants) if index and participant.process]
        dying = [index for index in there if participants[index].to_be_killed]
        acting = [index for index in there if index not in dying and participants[index].return_s <= now_s]
        taking = [index for index in acting if self._has_work(participants[index], now_s)]
        for index in taking:
            self._notify(self._pipes[index])
        self._acted = False
        self._wait_until_finished(taking)
        for index in dying:
            self._kill(index)
        due_s = min(participants[index].due_s for index in (self.index, *acting))
        if page.sent_turn == page.turn:
            due_s = now_s
        # Also of processes that are missing: a successor may be there or not.
        back_s = min((each.return_s for each in participants if each.return_s > now_s), default=due_s)
        page.time_s = ceil(max(min(due_s, back_s), now_s + STEP_S) * _TICKS) / _TICKS
        page.turn += 1
        self._collect()
        return True

    def _has_work(self, participant: ParticipantState, now_s: float) -> bool:
        return bool(
            participant.due_s <= now_s
            or participant.called
            or participant.mail_turn >= participant.finished
            or (participant.listens and self._acted)
            or self.page.counter_turn >= self.page.turn - 1
        )

    def _wait_for_participants(self) -> None:
        """Wait until no process is missing."""
        page = self.page
        while True:
            for index in range(len(self._participants), page.used_participants):
                self._participants.append(page.participants[index])
                self._pipes.append(os.open(page.pipe(index), os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC))
            missing = any(participant.missing(page.time_s) for participant in self._participants[1:])
            if self.interrupted() or not missing:
                return
            self._notified(self._scheduler)

    def _wait_until_finished(self, taking: list[int]) -> None:
        """Wait until processes have finished the turn, have left, or have died."""
        turn, participants = self.page.turn, self._participants
        while taking and not self.interrupted():
            taking = [
                index
                for index in taking
                if participants[index].process and participants[index].finished != turn
            ]
            if taking and not self._notified(self._scheduler):
                for index in taking:
                    try:
                        os.kill(participants[index].process, 0)
                    except ProcessLookupError:
                        self._note_death(index)

    def _kill(self, index: int) -> None:
        """Kill a process, and wait until its descriptors are closed."""
        process = self._participants[index].process
        # Before the supervisor notices.
        self._note_death(index)
        with suppress(ProcessLookupError):
            descriptor = os.pidfd_open(process)
            signal.pidfd_send_signal(descriptor, signal.SIGKILL)
            select.select([descriptor], [], [])
            os.close(descriptor)

    def _note_death(self, index: int) -> None:
        """Note the death of a process."""
        participant = self._participants[index]
        self.page.release(index)
        participant.lived_s = self.page.time_s - participant.began_s
        participant.to_be_killed, participant.return_s = 0, self.page.time_s + RETURN_S


def participant_of(page: Path, process: str, await_subscriptions: Callable[[], None]) -> Participant:
    """Return what takes the turns of a process: the simulator advances the time; see `Participant`."""
    kind = Scheduler if process == SIMULATOR else Participant
    return kind(opened_page(page), process, await_subscriptions)
