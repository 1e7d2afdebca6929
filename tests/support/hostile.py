"""Hostile controllers: sound for a while, then whatever a program of a student may do.

These are plug-ins; `hostile_program.py` is the same as a program outside.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np
from msgspec import Struct

from rcopterx.control.interfaces import ControlStep, Estimate, never
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.control.scheme import Situation
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array
from support.failing import WrappingController

SOUND_S = 1.0
"""How long a hostile controller is sound."""
TILT_RATE_S = 0.5
"""Period of the tilt of a helicopter, at which swinging the sticks excites it most."""

STICKS: dict[str, Callable[[float], tuple[float, float, float, float]]] = {
    "saturating: dives": lambda _: (0.0, 0.0, -1.0, 0.0),
    "saturating: climbs": lambda _: (0.0, 0.0, 1.0, 0.0),
    "saturating: ahead": lambda _: (1.0, 0.0, 0.0, 0.0),
    "saturating: aside": lambda _: (0.0, 1.0, 0.0, 0.0),
    "saturating: to the other side": lambda _: (0.0, -1.0, 0.0, 0.0),
    "saturating: at the leader": lambda _: (0.8, -0.6, 0.0, 0.0),
    "saturating: spins": lambda _: (0.0, 0.0, 0.0, 1.0),
    "saturating: all": lambda _: (-1.0, 1.0, -1.0, -1.0),
    "oscillating: tilt": lambda t_s: (side(t_s, TILT_RATE_S), side(t_s, TILT_RATE_S), 0.0, 0.0),
    "oscillating: thrust": lambda t_s: (0.0, 0.0, side(t_s, 1.0), 0.0),
    "oscillating: all": lambda t_s: 4 * (side(t_s, 0.04),),  # type: ignore[return-value]  # four of them
}
"""Sticks as shares of their ways from hovering to their limits."""


def side(time_s: float, period_s: float) -> float:
    """1 and -1 in turns."""
    return 1.0 if time_s % period_s < period_s / 2 else -1.0


def pushed(model: Model, shares: Sequence[float]) -> Array:
    """Input with sticks pushed towards their limits."""
    hover, pushing = model.hover_input, np.array(shares)
    way = np.where(pushing > 0.0, model.u_max - hover, hover - model.u_min)
    return np.asarray(hover + pushing * way)


class HostileController(WrappingController):
    """A controller of some kind of `KINDS`."""

    class Settings(Struct):
        horizon: int = 30
        kind: str = "raising"

    def __init__(self, model: Model, period_s: float, settings: Settings) -> None:
        super().__init__(CONTROLLERS.build("pid", model, period_s, {"horizon": settings.horizon}))
        self._model, self._kind = model, settings.kind

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        step = self.sound_step(estimate, reference, last_input, expired)
        hostile_s = self.steps * self.period_s - SOUND_S
        return step if hostile_s < 0.0 else self._hostile(step, hostile_s)

    def _hostile(self, step: ControlStep, hostile_s: float) -> ControlStep:
        if self._kind in STICKS:
            sticks = pushed(self._model, STICKS[self._kind](hostile_s))
            return ControlStep(np.tile(sticks, (len(step.inputs), 1)), step.plan, None, 0)
        return DEEDS[self._kind](step)  # type: ignore[return-value]  # not all return a step


def _raising(_: ControlStep) -> object:
    raise RuntimeError("a table is missing")


def _hanging(_: ControlStep) -> object:
    time.sleep(3600.0)


def _late(step: ControlStep) -> object:
    until_s = time.thread_time() + 0.05
    while time.thread_time() < until_s:
        pass
    return step


def _not_finite(step: ControlStep) -> object:
    return ControlStep(step.inputs * np.nan, step.plan, None, 0)


DEEDS: dict[str, Callable[[ControlStep], object]] = {
    "raising": _raising,
    "hanging": _hanging,
    "late": _late,
    "silent": lambda _: None,
    "not finite": _not_finite,
}


class FloodingScheme(HostileController):
    """Sends as much as it can, and more."""

    class Message(Struct):
        text: str

    exchanges = 1_000_000

    def exchange(self, situation: Situation) -> Struct | None:
        size = 4000 if situation.time_s % 1.0 < 0.5 else 1_000_000
        return self.Message("x" * size)


KINDS = (*DEEDS, *STICKS)
