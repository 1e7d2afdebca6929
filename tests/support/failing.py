"""Controllers and estimators that fail in every way that foreign ones may."""

import time
from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from rcopterx.control.interfaces import Controller, ControlStep, Estimate, never
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.state import Array


class BrokenError(Exception):
    """Raised by what is broken."""


def _raise(step: ControlStep) -> ControlStep:
    raise BrokenError("a table is missing")


def _with(change: Callable[[Array], Array]) -> Callable[[ControlStep], ControlStep]:
    return lambda step: replace(step, inputs=change(step.inputs))


def _with_plan(change: Callable[[Array], Array]) -> Callable[[ControlStep], ControlStep]:
    return lambda step: replace(step, plan=Trajectory(change(step.plan.samples), step.plan.period_s))


FAILURES: dict[str, Callable[[ControlStep], object]] = {
    "raises": _raise,
    "returns nothing": lambda step: None,
    "returns a row": _with(lambda inputs: inputs[0]),
    "returns too few rows": _with(lambda inputs: inputs[:-1]),
    "returns text": _with(lambda inputs: inputs.astype(str)),
    "returns objects": _with(lambda inputs: np.full(inputs.shape, None)),
    "inputs are not a number": _with(lambda inputs: inputs * np.nan),
    "inputs are infinite": _with(lambda inputs: inputs + np.inf),
    "inputs leave the limits": _with(lambda inputs: inputs + 3.0),
    "plan is not a number": _with_plan(lambda samples: samples * np.nan),
    "plan is too short": _with_plan(lambda samples: samples[:2]),
    "plan is huge": _with_plan(lambda samples: samples + 1e9),
    "another period": lambda step: replace(step, plan=Trajectory(step.plan.samples, 0.5)),
    "no plan": lambda step: replace(step, plan=None),
    "fallback is a number": lambda step: replace(step, fallback=3),
}


class WrappingController:
    """Wraps a sound controller, and counts its steps."""

    def __init__(self, sound: Controller) -> None:
        self._sound = sound
        self.steps = 0

    @property
    def horizon(self) -> int:
        return self._sound.horizon

    @property
    def period_s(self) -> float:
        return self._sound.period_s

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        self._sound.reset(estimate, last_input)

    def sound_step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        """The next step of the sound controller."""
        self.steps += 1
        return self._sound.step(estimate, reference, last_input, expired)


class FailingController(WrappingController):
    """Has the failures of `course` in its steps, cyclically; None for none."""

    def __init__(self, sound: Controller, course: Sequence[str | None]) -> None:
        super().__init__(sound)
        self._course = course

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        failure = self._course[self.steps % len(self._course)]
        step = self.sound_step(estimate, reference, last_input, expired)
        return step if failure is None else FAILURES[failure](step)  # type: ignore[return-value]


def compute_for(seconds: float) -> None:
    """Keep the processor busy, in Python."""
    until_s = time.thread_time() + seconds
    while time.thread_time() < until_s:
        pass
