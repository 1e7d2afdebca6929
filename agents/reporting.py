"""What an agent tells of itself: status for others and for people, intent for its successor."""

import logging
from typing import Final

from rcopterx.agents.assembly import AgentParts
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
    """Publishes status and intent of one agent, at its period and soon after a change.

    Parameters
    ----------
    settings, pilot
        The vehicle's.
    bus
        The agent's seat on it.
    parts
        What the agent is made of.

    Attributes
    ----------
    said
        Newest status that was published; None before the first.
    due_s
        When the next report is due [monotonic s].
    """

    def __init__(self, settings: AgentSettings, pilot: Pilot, bus: StepBus, parts: AgentParts) -> None:
        self._vehicle, self._pilot, self._bus, self._parts = settings.vehicle, pilot, bus, parts
        self._remarked: set[str] = set()
        self.begin()
        self.said: AgentStatus | None = None

    def begin(self) -> None:
        """Report a period from now on: an agent that takes over knows by then whether it flies."""
        self.due_s = self._bus.clock() + REPORT_PERIOD_S

    def soon(self) -> None:
        """Whoever restarts this agent a moment later must know of a change."""
        self.due_s = self._bus.clock()

    def report(self) -> None:
        """Publish status and intent; between them leaders are given the limits their followers leave them."""
        now_s, pilot, parts = self._bus.clock(), self._pilot, self._parts
        slower = SPARSE if parts.relief.relief >= Relief.STATUSES else 1
        self.due_s = now_s + slower * REPORT_PERIOD_S
        links = {name: status.following for name, status in parts.peers.statuses().items()}
        controller, chosen = pilot.controller, parts.tuning.configuration.controller_settings
        pilot.step_guard.try_call(controller, lambda: parts.limit_scaling.tend(controller, chosen, links))
        leaders = [link.leader for link in pilot.guidance.followed]
        plan_age_s = parts.plans.plan_age_s(now_s, leaders)
        diagnostics = parts.diagnostics.collect(
            parts.observation.pose_age_s, plan_age_s, parts.external.client
        )
        for remark in set(diagnostics.remarks) - self._remarked:
            _LOG.warning(remark)
        self._remarked = set(diagnostics.remarks)
        self.said = status_message(pilot, parts.lost.following_mode, diagnostics)
        self._bus.publish(channels.AGENT_STATUS, self._vehicle, self.said)
        parts.handover.publish()
