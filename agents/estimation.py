"""State estimation of one vehicle: poses and the inputs that act in between, to the present estimate.

An estimator may be a plug-in. Once it fails, the default one continues from the last good estimate.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from rcopterx.agents.flight.timeline import FleetClock, InputHistory
from rcopterx.agents.guards.time_limit import GuardedCall
from rcopterx.control.interfaces import Estimate, EstimatesUncertainty, Estimator, Measurement
from rcopterx.control.models.prediction import flaw_of, predict
from rcopterx.control.references.trajectory import nearest_heading
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE, YAW, Array, body_motion

BLIND_LIMIT_S: Final = 0.3
OCCLUDED: Final = "occluded"  # counted when the motion capture misses the vehicle in a frame

STEP_LIMIT_S: Final = 0.006  # longest duration of one call of an estimator
FIRST_CALLS: Final = 10
FIRST_CALLS_FACTOR: Final = 8.0  # for first calls, which load code and fill caches

T = TypeVar("T")


class EstimatorGuard:
    """An `Estimator` that continues with the default one, or the last estimate, if the selected one fails."""

    def __init__(self, estimator: Estimator, default: Estimator | None = None) -> None:
        # counts and describes failures
        self.calls = GuardedCall("estimator", FIRST_CALLS, FIRST_CALLS_FACTOR)
        self.replaced = False  # whether the default estimator has replaced the selected one
        self.default = default  # replaces an estimator that fails
        # the last good estimate
        self.estimate = Estimate(np.zeros(MOTION_SIZE), np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))
        self._started = False
        self._select(estimator)
        self._call(_nothing)

    @property
    def events(self) -> Mapping[str, int]:
        """Failures by kind, the events that the estimator counts, and jumps that it has accepted."""
        accepted = {"jump_accepted": getattr(self._estimator, "restarts", 0)}
        counts = {**self.calls.failures, **getattr(self._estimator, "events", {}), **accepted}
        return {kind: count for kind, count in counts.items() if count}

    def position_deviation_m(self) -> Array | None:
        """Return the standard deviations of the position; None if the estimator does not estimate them."""
        if self._uncertain is None:
            return None
        call = self._uncertain.position_deviation_m
        return self.calls.attempt(self._name, STEP_LIMIT_S, _deviation_problem, call)

    def use(self, estimator: Estimator, started: bool) -> None:
        """Select another estimator; it continues from the present estimate if the vehicle has `started`."""
        self._select(estimator)
        self.replaced, self.calls.failure = False, ""
        if started:
            self.take_over(self.estimate)
        else:
            self._call(_nothing)

    def _select(self, estimator: Estimator) -> None:
        self._estimator, self._name = estimator, type(estimator).__name__
        self._uncertain = estimator if isinstance(estimator, EstimatesUncertainty) else None
        self.calls.begin()

    def use_default(self) -> bool:
        """Replace the estimator by the default one; False if that is in use, or there is none."""
        if self.default is None or self._estimator is self.default:
            return False
        self._select(self.default)
        self.replaced = True
        self._restart()
        return True

    def reset(self, measurement: Measurement, velocity_m_s: Array | None = None) -> None:
        """Start at a pose, with an inertial velocity, shape (3,), or at rest as `Estimator.reset`."""
        if velocity_m_s is None:
            self._call(lambda estimator: estimator.reset(measurement))
            self._started = True
            return
        pose = np.array((*measurement.position_m, measurement.yaw_rad))
        motion = body_motion(pose, np.array((*velocity_m_s, 0.0)))
        self.take_over(Estimate(motion, self.estimate.actuator, self.estimate.disturbance))

    def take_over(self, estimate: Estimate) -> None:
        """See `Estimator.take_over`."""
        self._call(lambda estimator: estimator.take_over(estimate))
        self._started = True

    def predict(self, applied_input: Array, period_s: float) -> None:
        """See `Estimator.predict`."""
        self._call(lambda estimator: estimator.predict(applied_input, period_s))

    def correct(self, measurement: Measurement, after: Sequence[tuple[Array, float]] = ()) -> bool:
        """Predict under the inputs `after` and for how long each acted [s], then correct by a pose."""

        def corrected(estimator: Estimator) -> bool:
            for applied_input, period_s in after:
                estimator.predict(applied_input, period_s)
            return estimator.correct(measurement)

        return bool(self._call(corrected))

    def _call(self, call: Callable[[Estimator], T]) -> T | None:
        """Return the result for the estimator, or for the default one if that fails; None if both fail."""
        found = self._attempt(call)
        if found is None:
            if self.use_default():
                return self._call(call)
            self._restart()
            return None
        result, self.estimate = found
        return result

    def _restart(self) -> None:
        """Restart the estimator from the last good estimate, as its own state cannot be trusted any more."""
        if self._started:
            found = self._attempt(lambda estimator: estimator.take_over(self.estimate))
            if found is not None:
                _, self.estimate = found

    def _attempt(self, call: Callable[[Estimator], T]) -> tuple[T, Estimate] | None:
        """Return the result of a call and the estimate after it; None if the call or the estimate fails."""
        own = self._estimator
        return self.calls.attempt(
            self._name, STEP_LIMIT_S, lambda found: flaw_of(found[1]), lambda: (call(own), own.estimate)
        )


def _nothing(_: Estimator) -> None:
    """Leave an estimator as it is."""


def _deviation_problem(deviation: Array) -> str | None:
    """Return what makes standard deviations of a position unusable; None if they are usable."""
    usable = deviation.shape == (3,) and bool(np.isfinite(deviation).all()) and bool((deviation >= 0.0).all())
    return None if usable else "the uncertainty of the position is not three numbers from 0 on"


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

    def __init__(
        self, clock: FleetClock, estimator: EstimatorGuard, inputs: InputHistory, events: Counter[str]
    ) -> None:
        self._events = events
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
            self._events["gated_pose"] += 1
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
        self._events[event] += 1

    def _predict(self, acted: list[tuple[Array, float]]) -> None:
        for value, duration_s in acted:
            self._estimator.predict(value, duration_s)
