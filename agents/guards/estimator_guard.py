"""Guard between pilot and estimator: once this fails, the default one continues from the last estimate."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeVar

import numpy as np

from rcopterx.agents.guards.guarded_call import GuardedCall
from rcopterx.control.estimators.base import body_motion
from rcopterx.control.interfaces import Estimate, EstimatesUncertainty, Estimator, Measurement
from rcopterx.control.models.finite import flaw_of
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE, Array

STEP_LIMIT_S: Final = 0.006  # longest duration of one call
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
        self._estimator = estimator
        self._started = False
        self._read_estimate()

    @property
    def events(self) -> Mapping[str, int]:
        """Failures by kind, the events that the estimator counts, and jumps that it has accepted."""
        accepted = Counter(jump_accepted=getattr(self._estimator, "restarts", 0))
        return self.calls.failures + Counter(getattr(self._estimator, "events", {})) + accepted

    def position_deviation_m(self) -> Array | None:
        """Return the standard deviations of the position; None if the estimator does not estimate them."""
        estimator = self._estimator
        if not isinstance(estimator, EstimatesUncertainty):
            return None
        name = type(estimator).__name__
        return self.calls.attempt(name, STEP_LIMIT_S, estimator.position_deviation_m, _deviation_problem)

    def use(self, estimator: Estimator, started: bool) -> None:
        """Select another estimator; it continues from the present estimate if the vehicle has `started`."""
        self._estimator, self.replaced, self.calls.failure = estimator, False, ""
        self.calls.begin()
        if started:
            self.take_over(self.estimate)
        else:
            self._read_estimate()

    def use_default(self) -> bool:
        """Replace the estimator by the default one; False if that is in use, or there is none."""
        if self.default is None or self._estimator is self.default:
            return False
        self._estimator, self.replaced = self.default, True
        self.calls.begin()
        self._restart()
        return True

    def reset(self, measurement: Measurement, velocity_m_s: Array | None = None) -> None:
        """Start at a pose, with an inertial velocity, shape (3,), or at rest as `Estimator.reset`."""
        if velocity_m_s is None:
            self._call(lambda estimator: estimator.reset(measurement), None)
            self._started = True
            return
        pose = np.array((*measurement.position_m, measurement.yaw_rad))
        motion = body_motion(pose, np.array((*velocity_m_s, 0.0)))
        self.take_over(Estimate(motion, self.estimate.actuator, self.estimate.disturbance))

    def take_over(self, estimate: Estimate) -> None:
        """See `Estimator.take_over`."""
        self._call(lambda estimator: estimator.take_over(estimate), None)
        self._started = True

    def predict(self, applied_input: Array, period_s: float) -> None:
        """See `Estimator.predict`."""
        self._call(lambda estimator: estimator.predict(applied_input, period_s), None)

    def correct(self, measurement: Measurement, after: Sequence[tuple[Array, float]] = ()) -> bool:
        """Predict under the inputs `after` and for how long each acted [s], then correct by a pose."""

        def follow(estimator: Estimator) -> bool:
            for applied_input, duration_s in after:
                estimator.predict(applied_input, duration_s)
            return estimator.correct(measurement)

        return bool(self._call(follow, False))

    def _read_estimate(self) -> None:
        self._call(lambda _: None, None)

    def _call(self, method: Callable[[Estimator], T], otherwise: T) -> T:
        """Call the estimator, and the default one if that fails; return `otherwise` if both fail."""
        result = self._attempt(method)
        if result is None and self.use_default():
            result = self._attempt(method)
        if result is None:
            self._restart()
            return otherwise
        return result[0]

    def _restart(self) -> None:
        """Restart the estimator from the last good estimate, as its own state cannot be trusted any more."""
        if self._started:
            good = self.estimate
            self._attempt(lambda estimator: estimator.take_over(good))

    def _attempt(self, method: Callable[[Estimator], T]) -> tuple[T, Estimate] | None:
        """Return the result of a call and the estimate after it; None after a failure, which is counted."""
        estimator = self._estimator
        name = type(estimator).__name__
        result = self.calls.attempt(
            name,
            STEP_LIMIT_S,
            lambda: (method(estimator), estimator.estimate),
            lambda result: flaw_of(result[1]),
        )
        if result is not None:
            self.estimate = result[1]
        return result


def _deviation_problem(deviation: Array) -> str | None:
    """Return what makes standard deviations of a position unusable; None if they are usable."""
    usable = deviation.shape == (3,) and bool(np.isfinite(deviation).all()) and bool((deviation >= 0.0).all())
    return None if usable else "the uncertainty of the position is not three numbers from 0 on"
