"""Reports of an agent: status for other vehicles and people, intent for its successor."""

import logging
from typing import Final

from rcopterx.agents.assembly import AgentParts
from rcopterx.agents.diagnostics import diagnostics_of
from rcopterx.agents.formation.limit_scaling import LimitScaling
from rcopterx.agents.load.overload import Relief
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.telemetry import status_message
from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus
from rcopterx.bus.stepping import StepBus

_LOG = logging.getLogger(__name__)

REPORT_PERIOD_S: Final = 0.2
SPARSE: Final = 2
"""Factor of the period while the computer cannot keep up; a status counts for a second."""


class Reporter:
    """Publishes status and intent of one agent, periodically and at once after a change.

    Attributes
    ----------
    last_status
        Newest status that was published; None before the first.
    due_s
        When the next report is due [monotonic s].
    """

    def __init__(
        self, settings: AgentSettings, pilot: Pilot, bus: StepBus, parts: AgentParts, realtime: bool
    ) -> None:
        self._settings, self._pilot, self._bus, self._parts = settings, pilot, bus, parts
        self._realtime = realtime
        self._limit_scaling = LimitScaling(settings.vehicle, settings.models)
        self._logged_remarks: set[str] = set()
        self.last_status: AgentStatus | None = None
        self.begin()

    def begin(self) -> None:
        """Report a period from now on: an agent that takes over knows by then whether it flies."""
        self.due_s = self._bus.clock() + REPORT_PERIOD_S

    def request_report(self) -> None:
        """Report in this step, so that a successor of this agent knows of a change."""
        self.due_s = self._bus.clock()

    def report(self) -> None:
        """Publish status and intent; before that, adapt the limits of a leader to its followers."""
        now_s, pilot, parts, vehicle = self._bus.clock(), self._pilot, self._parts, self._settings.vehicle
        slower = SPARSE if parts.relief.relief >= Relief.STATUSES else 1
        self.due_s = now_s + slower * REPORT_PERIOD_S
        self._scale_limits()
        diagnostics = diagnostics_of(self._settings, pilot, parts, self._realtime, now_s)
        remarks = set(diagnostics.remarks)
        for remark in remarks - self._logged_remarks:
            _LOG.warning(remark)
        self._logged_remarks = remarks
        self.last_status = status_message(pilot, parts.lost.following_mode, diagnostics)
        self._bus.publish(channels.AGENT_STATUS, vehicle, self.last_status)
        parts.handover.publish()

    def _scale_limits(self) -> None:
        links = {name: status.following for name, status in self._parts.peers.statuses().items()}
        controller, settings = self._pilot.controller, self._parts.tuning.configuration.controller_settings
        self._pilot.step_guard.try_call(
            controller, lambda: self._limit_scaling.update(controller, settings, links)
        )
