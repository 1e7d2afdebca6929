"""The conductor of a fleet in lockstep: the simulated laboratory, which advances the time."""

import os
import signal
from collections.abc import Collection
from contextlib import suppress
from math import ceil
from typing import Final

from rcopterx.bus.rounding import TIME_BITS
from rcopterx.bus.turns import Turns

STEP_S: Final = 2.0**-11  # least time between two turns; so long messages travel
RETURN_S: Final = 0.3  # time from the death of a process to the first turn of its successor
_TICKS: Final = 2.0**TIME_BITS


class Conductor(Turns):
    """Turns of the process that advances the time.

    It takes its own turn first, and then the others theirs. The next one follows after `STEP_S` if anything
    was sent, else when a process has something to do. A process that dies is replaced after `RETURN_S`: then
    time stands still until its successor is there.
    """

    def _enter(self) -> None:
        self._bells: dict[int, int] = {}
        self._own.wanted, self._own.process = 1, os.getpid()
        # A predecessor may have died during a turn.
        self.page.turn += 1

    def _take_turn(self) -> bool:
        """Let the others take the present turn, and begin the next one."""
        page, now_s = self.page, self.page.now()
        there = self._wait_for_players()
        resting = {index for index in there if page.players[index].return_s > now_s}
        doomed = {index for index in there if page.players[index].doomed}
        taking = there - resting - doomed
        for index in taking:
            self._ring(self._bell_of(index))
        self._wait_until_finished(taking)
        for index in doomed:
            with suppress(ProcessLookupError):
                os.kill(page.players[index].process, signal.SIGKILL)
            self._bury(index)
        due_s = min(page.players[index].due_s for index in (self.index, *taking))
        back_s = min((page.players[index].return_s for index in resting), default=due_s)
        page.time_s = ceil(max(min(due_s, back_s), now_s + STEP_S) * _TICKS) / _TICKS
        page.turn += 1
        self._collect()
        return True

    def _wait_for_players(self) -> set[int]:
        """Return the processes that are there, once none is missing."""
        page = self.page
        while True:
            others = range(1, page.used_players)
            there = {index for index in others if page.players[index].process}
            missing = [page.players[index] for index in others if index not in there]
            awaited = any(player.wanted and player.return_s <= page.time_s for player in missing)
            if not awaited or self.interrupted():
                return there
            self._rings(self._conductor)

    def _wait_until_finished(self, taking: Collection[int]) -> None:
        """Wait until processes have finished the turn, have left, or have died."""
        page = self.page
        while taking and not self.interrupted():
            taking = [
                index
                for index in taking
                if page.players[index].process and page.players[index].finished != page.turn
            ]
            if taking and not self._rings(self._conductor):
                for index in taking:
                    try:
                        os.kill(page.players[index].process, 0)
                    except ProcessLookupError:
                        self._bury(index)

    def _bury(self, index: int) -> None:
        """Note the death of a process."""
        player = self.page.players[index]
        self.page.release(index)
        player.doomed, player.return_s = 0, self.page.time_s + RETURN_S

    def _bell_of(self, index: int) -> int:
        if index not in self._bells:
            path = self.page.bell(index)
            self._bells[index] = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        return self._bells[index]
