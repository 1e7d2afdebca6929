"""What stands between an estimator and its pilot: whatever an estimator does, there is an estimate.

An estimator may be somebody else's. Once it raises, tells an estimate that is none or does not return in
time, its state cannot be trusted any more: the default estimator goes on from the last good estimate.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeVar

import numpy as np

from rcopterx.agents.guards.guarded_call import FailureKinds, GuardedCall
from rcopterx.agents.guards.time_limit import TimeLimit
from rcopterx.control.interfaces import Estimate, EstimatesUncertainty, Estimator, Measurement
from rcopterx.control.models.finite import flaw_of
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE, Array

RAISED: Final = "estimator_raised"
UNUSABLE: Final = "estimator_unusable"
LATE: Final = "estimator_late"
STEP_LIMIT_S: Final = 0.006
"""Time that one call may take."""
FIRST_CALLS: Final = 10
FIRST_CALLS_FACTOR: Final = 8.0
"""The first calls load code and fill caches; they may take so many times as long."""

T = TypeVar("T")


class EstimatorGuard:
    """An `Estimator` that goes on with the default one when the one that it asks fails.

    Parameters
    ----------
    estimator
        The one to ask.
    default
        Takes its place; None for none, which leaves the last good estimate where the estimator fails.
    limit
        Time that a call may take.

    Attributes
    ----------
    calls
        Counts and tells failures.
    """

    def __init__(
        self, estimator: Estimator, default: Estimator | None = None, limit: TimeLimit | None = None
    ) -> None:
        kinds = FailureKinds(RAISED, UNUSABLE, LATE)
        self.calls = GuardedCall(kinds, FIRST_CALLS, FIRST_CALLS_FACTOR, limit)
        self.replaced = False
        """Whether the default estimator has taken the place of the one that was chosen."""
        self._asked = estimator
        self._default = default
        self._begun = False
        self._known: Estimator | None = None
        self._telling: EstimatesUncertainty | None = None
        nowhere = Estimate(np.zeros(MOTION_SIZE), np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))
        self.estimate = nowhere
        """The last good estimate."""
        self._ask(lambda _: None, None)

    @property
    def events(self) -> Mapping[str, int]:
        """Failures by kind, and what the estimator counts."""
        return self.calls.failures + Counter(getattr(self._asked, "events", {}))

    def position_deviation_m(self) -> Array | None:
        """How well the estimator knows the position (`EstimatesUncertainty`); None if it does not tell."""
        asked = self._asked
        if asked is not self._known:
            # Asking for a protocol takes longer than most of what is done here, so it is done once.
            self._known = asked
            self._telling = asked if isinstance(asked, EstimatesUncertainty) else None
        if self._telling is None:
            return None
        question = self._telling.position_deviation_m
        return self.calls.attempt(type(asked).__name__, STEP_LIMIT_S, question, _deviation_problem)

    def use(self, estimator: Estimator, started: bool) -> None:
        """Ask another estimator from now on; it goes on from the present estimate once that has started."""
        self._asked, self.replaced, self.calls.failure = estimator, False, ""
        self.calls.begin()
        if started:
            self.take_over(self.estimate)
        else:
            self._ask(lambda _: None, None)

    def use_default(self) -> bool:
        """Ask the default estimator from now on; False if it is asked already, or there is none."""
        if self._default is None or self._asked is self._default:
            return False
        self._asked, self.replaced = self._default, True
        self.calls.begin()
        self._go_on()
        return True

    def reset(self, measurement: Measurement) -> None:
        """See `Estimator.reset`."""
        self._ask(lambda asked: asked.reset(measurement), None)
        self._begun = True

    def take_over(self, estimate: Estimate) -> None:
        """See `Estimator.take_over`."""
        self._ask(lambda asked: asked.take_over(estimate), None)
        self._begun = True

    def predict(self, applied_input: Array, period_s: float) -> None:
        """See `Estimator.predict`."""
        self._ask(lambda asked: asked.predict(applied_input, period_s), None)

    def correct(self, measurement: Measurement, after: Sequence[tuple[Array, float]] = ()) -> bool:
        """Take in a pose (`Estimator.correct`), in one call with the predictions up to it.

        Parameters
        ----------
        measurement
            The pose.
        after
            Inputs that acted since the last call, and for how long each [s].
        """

        def follow(asked: Estimator) -> bool:
            for applied_input, duration_s in after:
                asked.predict(applied_input, duration_s)
            return asked.correct(measurement)

        return bool(self._ask(follow, False))

    def _ask(self, question: Callable[[Estimator], T], otherwise: T) -> T:
        """Ask the estimator, and the default one if that fails; `otherwise` if nobody knows."""
        answer = self._attempt(question)
        if answer is None and self.use_default():
            answer = self._attempt(question)
        if answer is None:
            self._go_on()
            return otherwise
        return answer[0]

    def _go_on(self) -> None:
        """Start from the last good estimate, as what the estimator knows cannot be trusted any more."""
        if not self._begun:
            return
        good = self.estimate
        self._attempt(lambda asked: asked.take_over(good))

    def _attempt(self, question: Callable[[Estimator], T]) -> tuple[T, Estimate] | None:
        """Answer of an estimator and its estimate after it; None after a failure, which is counted."""
        asked = self._asked

        def told() -> tuple[T, Estimate]:
            return question(asked), asked.estimate

        answer = self.calls.attempt(type(asked).__name__, STEP_LIMIT_S, told, lambda pair: flaw_of(pair[1]))
        if answer is not None:
            self.estimate = answer[1]
        return answer


def _deviation_problem(deviation: Array) -> str | None:
    """What makes standard deviations of a position unusable; None if they can be used."""
    usable = deviation.shape == (3,) and bool(np.isfinite(deviation).all()) and bool((deviation >= 0.0).all())
    return None if usable else "the uncertainty of the position is not three numbers from 0 on"
