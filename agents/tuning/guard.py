"""The guard against oscillation: lowers the bandwidth of a controller whose vehicle oscillates.

A vehicle may differ from its model by more than the weights allow. The input weights of the loop that
oscillates rise step by step until the oscillation ends. Each step is prepared like any other change. The
weights stay until the vehicle is tuned, or its filter has found a lever arm that it flew without. A vehicle
that drifts with the largest weights lands.
"""

import math
from dataclasses import replace
from typing import Final

from rcopterx.agents.flight.oscillation import Loop, OscillationDetector
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.configuration import EFFORT_FACTORS, Configuration
from rcopterx.bus.messages import Diagnostics
from rcopterx.bus.requests import Tune
from rcopterx.control.estimators.extended_kalman import LEVER_ARM_FOUND
from rcopterx.control.plugins import flying
from rcopterx.vehicles.phases import Phase

STEP: Final = 3.0
LARGEST: Final = STEP**4
SHORTEST_STEP_S: Final = 0.25  # time between two steps

DRIFT_M: Final = 0.1  # further off its place, a vehicle with the largest weights drifts
DRIFT_S: Final = 10.0  # ...and lands once it has drifted longer than it was at its place by so much

OSCILLATION: Final = "oscillation"  # counted for every half-wave of an oscillation
BANDWIDTH_LOWERED: Final = "bandwidth_lowered"  # counted for every step
DRIFTED: Final = "bandwidth_exhausted"  # counted for every landing of a vehicle that drifts


def without_guard(configuration: Configuration) -> Configuration:
    """Return a configuration with the bandwidth before the guard lowered it."""
    settings = configuration.controller_settings
    kept = {name: value for name, value in settings.items() if name != EFFORT_FACTORS}
    return replace(configuration, controller_settings=kept)


class OscillationGuard:
    """Watches one vehicle."""

    def __init__(self, pilot: Pilot, tuning: Tuning) -> None:
        self._pilot = pilot
        self._tuning = tuning
        self._detector = OscillationDetector(pilot.model)
        self._since_step_s = SHORTEST_STEP_S
        self._swinging: frozenset[Loop] = frozenset()  # loops that have oscillated since the last step
        self._seen = ""  # oscillation at which the bandwidth was lowered last
        self._lands = ""  # why the vehicle lands
        self._drift_s = 0.0
        self._lever_arms = 0  # how often the filter had found a lever arm
        self._events = pilot.events

    @property
    def remark(self) -> str:
        """Why the vehicle lands, or the oscillation at which the bandwidth was lowered; empty once tuned."""
        lowered = max(self._tuning.configuration.effort_factors) > 1.0
        return (self._lands or self._seen) if lowered else ""

    def report(self, to: Diagnostics, now_s: float) -> None:  # noqa: ARG002 - see `Reports`
        """See `rcopterx.agents.reporting.Reports`."""
        to.remarks += (self.remark,)

    def watch(self, output: ControlOutput, flown_by_own: bool = True) -> None:
        """Process the last period, lower the bandwidth if necessary; not that of an external program."""
        pilot = self._pilot
        if self._detector.model is not pilot.model:
            self._detector = OscillationDetector(pilot.model)
        if output.reference is None or pilot.exciter.under_way:
            # Sines that an identification adds are no oscillation; should they bring one about, the vehicle
            # leaves its box, which ends them.
            self._detector.forget()
            return
        period_s, estimate = pilot.controller.period_s, pilot.estimate
        self._since_step_s += period_s
        self._raise_again()
        if flown_by_own:
            self._watch_drift(math.dist(estimate.motion[:3], output.reference[:3]), period_s)
        tilt = estimate.tilt.core if estimate.has_tilt else None
        swinging = self._detector.observe(output.input, tilt, estimate.motion, output.reference, period_s)
        if not swinging:
            return
        self._events[OSCILLATION] += 1
        self._swinging |= swinging
        if flown_by_own and not self._tuning.busy and self._since_step_s >= SHORTEST_STEP_S:
            self._lower()

    def _watch_drift(self, off_m: float, period_s: float) -> None:
        """Land a vehicle that drifts although the bandwidth cannot be lowered further."""
        lowest = max(self._tuning.configuration.effort_factors) >= LARGEST
        if not lowest:
            self._lands = ""
        if not lowest or self._pilot.guidance.task.phase is not Phase.FLYING:
            self._drift_s = 0.0
            return
        self._drift_s = max(0.0, self._drift_s + (period_s if off_m > DRIFT_M else -period_s))
        if self._drift_s > DRIFT_S:
            self._events[DRIFTED] += 1
            self._lands = f"it lands: {off_m:.2f} m off its place with the lowest bandwidth"
            self._pilot.guidance.land(self._pilot.estimate, self._pilot.clock.time_s)

    def _raise_again(self) -> None:
        """Return to the bandwidth before, and judge anew, once the filter has found the lever arm."""
        if self._tuning.busy:
            return
        before, self._lever_arms = self._lever_arms, self._pilot.estimator.events.get(LEVER_ARM_FOUND, 0)
        if self._lever_arms == before:
            return
        self._detector.forget()
        self._swinging, self._since_step_s = frozenset(), 0.0
        if max(self._tuning.configuration.effort_factors) > 1.0:
            self._tuning.begin(without_guard(self._tuning.configuration))

    def _lower(self) -> None:
        present = self._tuning.configuration
        swinging, self._swinging = self._swinging, frozenset()
        factors = [
            min(STEP * factor, LARGEST) if loop in swinging else factor
            for loop, factor in zip(Loop, present.effort_factors, strict=True)
        ]
        settings = flying(present.controller).load(present.controller).Settings
        lowest = factors == list(present.effort_factors)
        if lowest or EFFORT_FACTORS not in settings.__struct_fields__:
            return
        self._since_step_s = 0.0
        self._detector.changed(swinging)
        self._events[BANDWIDTH_LOWERED] += 1
        swings = [self._detector.swings[loop] for loop in sorted(swinging)]
        self._seen = "bandwidth lowered: " + ", ".join(
            f"{swing.signal} oscillated at {swing.frequency_hz:.1f} Hz by {swing.size:.2f} of its range"
            for swing in swings
        )
        self._tuning.begin(present.changed(Tune(controller_settings={EFFORT_FACTORS: tuple(factors)})))
