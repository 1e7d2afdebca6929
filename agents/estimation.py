"""State estimation of one vehicle: poses and the inputs that act in between, to the present estimate."""

from collections import Counter
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from rcopterx.agents.flight.fleet_clock import FleetClock
from rcopterx.agents.flight.inputs import InputHistory
from rcopterx.agents.guards.estimator_guard import EstimatorGuard
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.prediction import predict
from rcopterx.control.references.trajectory import nearest_heading
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import YAW, Array

BLIND_LIMIT_S: Final = 0.3
OCCLUDED: Final = "occluded"  # counted when the motion capture misses the vehicle in a frame


class StampedMeasurement(Struct, frozen=True):
    """One frame of the motion capture; `measurement` is None while the vehicle is occluded."""

    epoch: int
    frame: int
    period_s: float
    measurement: Measurement | None


class StateEstimation:
    """Predicts under the inputs of the history, corrects by poses, and starts again after long gaps.

    A `standing` vehicle is not predicted: the model knows no floor, so the prediction would fall.
    """

    def __init__(self, clock: FleetClock, estimator: EstimatorGuard, inputs: InputHistory) -> None:
        self.events: Counter[str] = Counter()
        self.blind_s = 0.0  # time since the last pose that the estimator accepted
        self.expected_yaw_rad = 0.0  # heading next to which the first measured one counts its turns
        self._clock, self._estimator, self._inputs = clock, estimator, inputs
        self._unseen_s = 0.0  # time since the last pose, accepted or not
        self._last_place_m: Array | None = None  # position of the newest pose; None if that was rejected

    @property
    def ready(self) -> bool:
        """Whether the vehicle has been seen."""
        return self._clock.started and self.blind_s < BLIND_LIMIT_S

    def observe(self, frame: StampedMeasurement, standing: bool) -> bool:
        """Process one frame; return False if it is older than the last one."""
        clock, measurement = self._clock, frame.measurement
        first = not clock.started
        if first and measurement is None:
            return False
        pending = clock.frames_until(frame.epoch, frame.frame, frame.period_s)
        if pending < 0:
            return False
        # Frames that were neither received nor coasted over, for instance while the process was stopped.
        self._unseen_s += max(0, pending - 1) * frame.period_s
        acted: list[tuple[Array, float]] = []
        for _ in range(min(pending, round(BLIND_LIMIT_S / frame.period_s))):
            start_s = clock.time_s
            clock.pass_period()
            if not standing:
                acted += self._inputs.between(start_s, clock.time_s)
        if measurement is None:
            self._bridge(acted, OCCLUDED)
            return True
        unseen_s, self._unseen_s = self._unseen_s, 0.0
        accepted = True
        if first or standing or unseen_s >= BLIND_LIMIT_S:
            self._predict(acted)
            near_rad = self.expected_yaw_rad if first else float(self._estimator.estimate.motion[YAW])
            self._restart(measurement, near_rad, 0.0 if first or standing else unseen_s)
        else:
            accepted = self._estimator.correct(measurement, acted)
        # The estimator decides for how long it rejects poses.
        self.blind_s = 0.0 if accepted else self.blind_s + frame.period_s
        self._last_place_m = measurement.position_m if accepted else None
        if not accepted:
            self.events["gated_pose"] += 1
        return True

    def coast(self, standing: bool) -> bool:
        """Predict over an overdue frame; return False beyond the limit of blind flight."""
        if not self.ready:
            return False
        start_s = self._clock.time_s
        self._clock.coast()
        acted = [] if standing else self._inputs.between(start_s, self._clock.time_s)
        self._bridge(acted, "pose_extrapolated")
        return self.ready

    def compensated(self, model: Model) -> Estimate:
        """Return the estimate at the moment when a command of the present begins to act."""
        time_s, estimate = self._clock.time_s, self._estimator.estimate
        for value, duration_s in self._inputs.between(time_s, time_s + model.delay_s):
            estimate = predict(model, estimate, value, duration_s)
        return estimate

    def _restart(self, measurement: Measurement, near_rad: float, moved_for_s: float) -> None:
        """Start at a pose, with the mean velocity of `moved_for_s` since the last one, or at rest."""
        yaw_rad = nearest_heading(measurement.yaw_rad, near_rad)
        velocity_m_s = None
        if moved_for_s > 0.0 and self._last_place_m is not None:
            velocity_m_s = (measurement.position_m - self._last_place_m) / moved_for_s
        self._estimator.reset(replace(measurement, yaw_rad=yaw_rad), velocity_m_s)

    def _bridge(self, acted: list[tuple[Array, float]], event: str) -> None:
        """Predict over a frame without a pose, which is counted."""
        self._predict(acted)
        self.blind_s += self._clock.period_s
        self._unseen_s += self._clock.period_s
        self.events[event] += 1

    def _predict(self, acted: list[tuple[Array, float]]) -> None:
        for value, duration_s in acted:
            self._estimator.predict(value, duration_s)
