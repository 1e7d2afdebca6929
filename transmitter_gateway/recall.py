"""Last output of an earlier process of this gateway, requested from the launcher until it answers."""

import threading
from collections import deque
from collections.abc import Iterable
from queue import SimpleQueue

from rcopterx.bus.requests import RecallTransmitter, RecallTransmitterReply, Reply
from rcopterx.bus.session import NotServedError, RequestFailedError, Session
from rcopterx.transmitter_gateway.inputs import NEUTRAL, LastApplied, State

ANSWER_LIMIT_S = 0.2
PATIENCE_S = 0.1
"""For a launcher that is about to find a new router."""


class Recall:
    """Requests the last applied inputs of several vehicles in a thread of its own, so that no radio waits."""

    def __init__(self, session: Session, vehicles: Iterable[str]) -> None:
        self._session = session
        self._open = deque(vehicles)
        self._answers: SimpleQueue[tuple[str, LastApplied | None]] = SimpleQueue()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="recall", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while self._open and not self._stopping:
            vehicle = self._open.popleft()
            requested_s = self._session.clock()
            try:
                reply = self._session.request(
                    vehicle, RecallTransmitter(), timeout_s=ANSWER_LIMIT_S, patience_s=PATIENCE_S
                )
            except NotServedError:
                last = None
            except RequestFailedError:
                self._open.append(vehicle)
                continue
            else:
                last = last_applied(reply, requested_s)
            self._answers.put((vehicle, last))
            self._session.wake()

    def answers(self) -> list[tuple[str, LastApplied | None]]:
        """Vehicles answered since the last call, and the last output to them, if there was one."""
        answers = []
        while not self._answers.empty():
            answers.append(self._answers.get_nowait())
        return answers

    def join(self) -> None:
        """Wait until everything is answered."""
        self._thread.join()

    def close(self) -> None:
        """Ask no more."""
        self._stopping = True
        self._thread.join()


def last_applied(reply: Reply, requested_s: float) -> LastApplied | None:
    """Last applied inputs in the answer to a request at `requested_s`; None if there were none."""
    if not isinstance(reply, RecallTransmitterReply):
        return None
    if reply.killed:
        return LastApplied(
            State.KILLED, NEUTRAL, requested_s - reply.age_s, lease=reply.lease, issued=reply.issued
        )
    if reply.applied is None:
        return None
    state = State(reply.applied.state.upper())
    return LastApplied(
        state, reply.applied.input, requested_s - reply.age_s, lease=reply.lease, issued=reply.issued
    )
