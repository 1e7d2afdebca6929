"""Handover between an agent and its successor: telling the intent, and taking up that of a predecessor."""

from typing import Final

from agents.intent import configuration_of, intent_of, passed_s, task_of
from agents.pilot import Pilot
from agents.tuning.changes import Tuning
from bus import channels
from bus.intent import Intent
from bus.messages import FloatArray
from bus.requests import Recall, RecallReply
from bus.session import RequestFailedError, Session
from vehicles.state import YAW

LONG_PERIOD_S: Final = 1.0
"""An intent with a path is long: as long as nothing changes it is told only so often."""
RECALL_TIMEOUT_S: Final = 0.2


class Handover:
    """Intent of one agent.

    Parameters
    ----------
    session
        The bus.
    vehicle
        Name of the vehicle.
    pilot, tuning
        The agent's own.

    Attributes
    ----------
    predecessor
        What the previous process of this agent meant to do; None if nobody remembers one.
    """

    def __init__(self, session: Session, vehicle: str, pilot: Pilot, tuning: Tuning) -> None:
        self._session = session
        self._vehicle = vehicle
        self._pilot = pilot
        self._tuning = tuning
        self._told: tuple[FloatArray | None, str] | None = None
        self._told_s = 0.0
        self.predecessor, self._predecessor_s = self._recall()
        if self.predecessor is not None and self.predecessor.yaw_rad is not None:
            pilot.expect_heading(self.predecessor.yaw_rad)

    def _recall(self) -> tuple[Intent | None, float]:
        """Newest intent of the predecessor, and when it was told [monotonic s]."""
        try:
            reply = self._session.request(self._vehicle, Recall(), timeout_s=RECALL_TIMEOUT_S, patience_s=0.0)
        except RequestFailedError:
            return None, 0.0
        if not isinstance(reply, RecallReply):
            return None, 0.0
        return reply.intent, self._session.clock() - reply.age_s

    def resume(self) -> bool:
        """Go on with the task of the predecessor, in flight; False without one."""
        intent, clock = self.predecessor, self._pilot.clock
        if intent is None:
            return False
        self._tuning.restore(configuration_of(intent))
        age_s = self._session.clock() - self._predecessor_s
        since_s = passed_s(intent, age_s, clock.epoch, clock.current_frame, clock.period_s)
        task = task_of(intent, clock.time_s, since_s)
        self._pilot.guidance.restore(task, self._pilot.estimate, clock.time_s)
        return True

    def publish(self) -> None:
        """Tell the present intent; to be called with every status."""
        clock, now_s = self._pilot.clock, self._session.clock()
        yaw_rad = float(self._pilot.estimate.motion[YAW]) if clock.started else None
        intent = intent_of(
            self._pilot.guidance.task(), self._tuning.configuration, clock.epoch, clock.current_frame,
            clock.time_s, yaw_rad,
        )  # fmt: skip
        told, task = self._told, (intent.path, intent.phase)
        if intent.path is not None and task == told and now_s - self._told_s < LONG_PERIOD_S:
            return
        self._told, self._told_s = task, now_s
        self._session.publish(channels.INTENT, self._vehicle, intent)
