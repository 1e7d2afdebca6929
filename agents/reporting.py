"""Reports of an agent: status for other vehicles and people, intent for its successor."""

import logging
import os
from collections import Counter
from collections.abc import Mapping
from typing import Final

from rcopterx.agents.assembly import AgentParts
from rcopterx.agents.formation.limit_scaling import LimitScaling
from rcopterx.agents.load.overload import Relief
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.telemetry import status_message
from rcopterx.agents.tuning.configuration import settings_in_message
from rcopterx.agents.tuning.guard import effort_factors
from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, Diagnostics
from rcopterx.bus.rounding import all_rounded, rounded
from rcopterx.bus.stepping import StepBus

_LOG = logging.getLogger(__name__)

REPORT_PERIOD_S: Final = 0.2
SPARSE: Final = 2
"""Factor of the period while the computer cannot keep up; a status counts for a second."""

DEVIATION_BITS: Final = 17
"""Standard deviations are rounded to a hundredth of a millimetre."""
HOVER_THRUST_BITS: Final = 10
"""Hover thrusts are rounded to a tenth of a per cent."""


class Reporter:
    """Publishes status and intent of one agent, periodically and at once after a change.

    Attributes
    ----------
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
        """Newest status that was published; None before the first."""
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


def diagnostics_of(
    settings: AgentSettings, pilot: Pilot, parts: AgentParts, realtime: bool, now_s: float
) -> Diagnostics:
    """Return the present figures of an agent; `realtime`: it runs in a real-time scheduling class."""
    configuration, times, relief = parts.tuning.configuration, parts.solve.times(), parts.relief
    remarks = (*pilot.remarks, parts.tuning.remark, relief.remark, parts.guard.remark)
    return Diagnostics(
        controller=configuration.controller,
        estimator=configuration.estimator,
        controller_settings=settings_in_message(configuration.controller_settings),
        estimator_settings=settings_in_message(configuration.estimator_settings),
        horizon=pilot.controller.horizon,
        effort_factor=max(effort_factors(configuration)),
        client=parts.external.client,
        pose_age_s=parts.observation.pose_age_s,
        plan_age_s=parts.plans.plan_age_s(now_s, pilot.guidance.leaders),
        ticks=parts.pacing.ticks,
        missed_ticks=parts.pacing.missed_ticks,
        solve_ms_p50=times.p50,
        solve_ms_p99=times.p99,
        solve_ms_max=times.maximum,
        fallbacks=_summed(
            pilot.events,
            parts.external.events,
            parts.lost.events,
            parts.changes.events,
            parts.guard.events,
            parts.requests.events,
            relief.events,
        ),
        estimator_events=dict(pilot.estimator.events),
        rejected=_summed(
            parts.observation.rejected, parts.plans.rejected, parts.traffic.rejected, parts.external.rejected
        ),
        avoiding_ticks=pilot.avoidance.ticks,
        closest_plan_m=pilot.avoidance.closest_m,
        hover_thrust=_hover_thrust(pilot),
        wind_m_s2=_wind(pilot),
        position_deviation_m=_position_deviation(pilot),
        realtime=realtime,
        process=os.getpid(),
        host=settings.bus.host or None,
        remarks=tuple(filter(None, remarks)),
        processor_share=relief.processor_share(),
    )


def _summed(*counts: Mapping[str, int]) -> dict[str, int]:
    total: Counter[str] = Counter()
    for each in counts:
        total.update(each)
    return dict(total)


def _hover_thrust(pilot: Pilot) -> float | None:
    """Share of the largest thrust at which the vehicle hovers; None on the floor."""
    learnt = pilot.self_check.hover_thrust if pilot.guidance.rotor_on else None
    return None if learnt is None else rounded(learnt, HOVER_THRUST_BITS)


def _wind(pilot: Pilot) -> tuple[float, float] | None:
    """Return the estimated wind [m/s^2]; None on the floor, where none is estimated."""
    if not pilot.guidance.rotor_on:
        return None
    estimate = pilot.estimate
    x, y = estimate.tilt.wind_m_s2 if estimate.has_tilt else estimate.disturbance[:2]
    return float(x), float(y)


def _position_deviation(pilot: Pilot) -> tuple[float, float, float] | None:
    """Return standard deviations of the position [m]; None on the floor, and if the estimator has none."""
    deviation = pilot.estimator.position_deviation_m() if pilot.guidance.rotor_on else None
    if deviation is None:
        return None
    x, y, z = all_rounded(deviation.tolist(), DEVIATION_BITS)
    return (x, y, z)
