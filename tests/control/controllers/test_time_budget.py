"""The cascade in the time that it has: stopped early, or interrupted anywhere."""

import sys
from itertools import count
from types import FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL, COAXIAL_LAG

from rcopterx.agents.guards.time_limit import OutOfTimeError
from rcopterx.control.controllers.base import EARLY_STOP
from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.interfaces import Estimate, Obstacle
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.model import Model

PERIOD_S = 0.02
HORIZON = 15
MODELS = pytest.mark.parametrize("model", [COAXIAL_LAG, COAXIAL], ids=["lag", "tilt"])
NEAR = Obstacle(np.tile((0.3, 0.1, 1.0), (HORIZON, 1)), np.tile((0.4, 0.4, 0.8), (HORIZON, 1)))


def flying(model: Model) -> CascadeController:
    """A controller that has begun to hover."""
    controller = CascadeController(model, PERIOD_S, CascadeSettings(horizon=HORIZON))
    controller.reset(at_rest(model), model.hover_input)
    controller.step(at_rest(model), reference(0.0, 0.0), model.hover_input)
    return controller


def at_rest(model: Model) -> Estimate:
    return Estimate(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), model.hover_input, np.zeros(4))


def reference(forward_m: float, turn_rad: float) -> Trajectory:
    return hold(np.array([forward_m, -forward_m, 1.0 + 0.3 * forward_m]), turn_rad, PERIOD_S, HORIZON)


@MODELS
@settings(deadline=None, max_examples=60)
@given(stop=st.integers(0, 60), crowded=st.booleans(), forward_m=st.floats(-3, 3), turn=st.floats(-3, 3))
def test_a_step_that_is_stopped_at_any_moment_gives_a_sound_command(
    model: Model, stop: int, crowded: bool, forward_m: float, turn: float
) -> None:
    controller, asked = flying(model), count()
    controller.set_obstacles([NEAR] if crowded else [])
    step = controller.step(
        at_rest(model), reference(forward_m, turn), model.hover_input, lambda: next(asked) >= stop
    )
    assert np.isfinite(step.inputs).all()
    assert np.isfinite(step.plan.samples).all()
    assert ((step.inputs >= model.u_min) & (step.inputs <= model.u_max)).all()
    assert step.plan.samples[0, :4] == pytest.approx(at_rest(model).motion[:4], abs=1e-9)
    assert step.fallback == (EARLY_STOP if next(asked) > stop else None)


@MODELS
def test_a_deadline_holds_for_one_step(model: Model) -> None:
    controller = flying(model)
    controller.set_obstacles([NEAR])
    far = reference(2.0, 2.0)
    assert controller.step(at_rest(model), far, model.hover_input, lambda: True).fallback == EARLY_STOP
    assert controller.step(at_rest(model), far, model.hover_input).fallback is None


class Interruption:
    """Raises what ends a late step, at one of the lines of the solvers."""

    def __init__(self, line: int) -> None:
        self._left = line

    def __call__(self, frame: FrameType, event: str, argument: Any) -> "Interruption | None":
        if "controllers" not in frame.f_code.co_filename:
            return None
        if event == "line":
            self._left -= 1
            if self._left < 0:
                sys.settrace(None)
                raise OutOfTimeError
        return self


@MODELS
@settings(deadline=None, max_examples=40)
@given(line=st.integers(0, 900), crowded=st.booleans())
def test_a_step_that_was_interrupted_anywhere_leaves_nothing_behind_after_a_reset(
    model: Model, line: int, crowded: bool
) -> None:
    interrupted, untouched = flying(model), flying(model)
    interrupted.set_obstacles([NEAR] if crowded else [])
    tracing = sys.gettrace()
    sys.settrace(Interruption(line))
    try:
        interrupted.step(at_rest(model), reference(2.5, 1.0), model.hover_input)
    except OutOfTimeError:
        pass
    finally:
        sys.settrace(tracing)
    steps = []
    for controller in (interrupted, untouched):
        controller.reset(at_rest(model), model.hover_input)
        controller.set_obstacles([])
        steps.append(controller.step(at_rest(model), reference(-1.0, 0.5), model.hover_input))
    assert steps[0].inputs == pytest.approx(steps[1].inputs, abs=1e-9)
    assert steps[0].plan.samples == pytest.approx(steps[1].plan.samples, abs=1e-7)
