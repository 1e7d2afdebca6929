"""Computing time of a whole control step, side by side with peers on the same problems.

Every contestant is a complete controller: checking, assembly in numpy, solving, plan. The paper's problem (11
states, one quadratic program) is solved by OSQP as we fly it, by PIQP and by HPIPM; the cascade's three
problems by our chain solver and by PIQP. All of them are stepped in turn through one recorded flight, in one
process on one processor, so that whatever disturbs the machine disturbs all alike. Times are the thread's
processor time: nobody waits for anything in a control step, and what other processes take is left out.
"""

import gc
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np

from rcopterx.benchmarks.flight import Moment, record_flight
from rcopterx.benchmarks.judge import judged_chain, judged_stage
from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.control.controllers.paper.controller import PaperController, PaperSettings
from rcopterx.control.controllers.paper.stage_qp import StageQP
from rcopterx.control.interfaces import Controller
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.types import COAXIAL_LAG

HORIZONS: Final = (10, 18, 30, 50, 80, 110)
STEPS: Final = 2000
PERIOD_S: Final = 0.02
WARM_UP_STEPS: Final = 20
ON_LIMIT: Final = 1e-6
"""An input this close to a limit is on it."""

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Contestant:
    """A controller with a solver.

    Attributes
    ----------
    kind
        `paper` or `cascade`.
    settings
        Of that controller.
    workspace
        Module and class of the solver; None for our own.
    package
        What must be installed.
    """

    kind: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    workspace: str | None = None
    package: str | None = None

    @property
    def installed(self) -> bool:
        """Whether its package is there."""
        return self.package is None or find_spec(self.package) is not None

    def build(self, horizon: int, errors: list[float] | None = None) -> Controller:
        """Controller with this solver; with `errors`, distances to the exact solution are collected there."""
        if self.kind == "paper":
            stage = self._workspace(StageQP)
            stage = stage if errors is None else judged_stage(stage, errors)
            paper = type("Contestant", (PaperController,), {"workspace": stage})
            return cast(
                Controller, paper(COAXIAL_LAG, PERIOD_S, PaperSettings(horizon=horizon, **self.settings))
            )
        chain = self._workspace(ChainQP)
        chain = chain if errors is None else judged_chain(chain, errors, COAXIAL_LAG)
        cascade = type("Contestant", (CascadeController,), {"workspace": chain})
        return cast(
            Controller, cascade(COAXIAL_LAG, PERIOD_S, CascadeSettings(horizon=horizon, **self.settings))
        )

    def _workspace(self, own: type[Any]) -> type[Any]:
        if self.workspace is None:
            return own
        module, name = self.workspace.split(":")
        peer: type[Any] = getattr(import_module(f"rcopterx.benchmarks.{module}"), name)
        return peer


_UNHURRIED: Final[dict[str, Any]] = {"time_limit_s": 1.0}
"""OSQP stops by the clock, which goes on while other processes have the processor."""
_EVERY_STEP: Final[dict[str, Any]] = {"relinearize": "every_step", **_UNHURRIED}
CONTESTANTS: Final[Mapping[str, Contestant]] = MappingProxyType(
    {
        "cascade": Contestant("cascade"),
        "cascade_no_lag": Contestant("cascade", {"actuator_lag": False}),
        "paper_constant": Contestant("paper", _UNHURRIED),
        "paper_relinearized": Contestant("paper", _EVERY_STEP),
        "piqp_multistage": Contestant("paper", _EVERY_STEP, "peer_piqp:PiqpMultistageQP", "piqp"),
        "piqp_sparse": Contestant("paper", _EVERY_STEP, "peer_piqp:PiqpStageQP", "piqp"),
        "hpipm": Contestant("paper", _EVERY_STEP, "peer_hpipm:HpipmStageQP", "casadi"),
        "clarabel": Contestant("paper", _EVERY_STEP, "peer_clarabel:ClarabelStageQP", "clarabel"),
        "proxqp": Contestant("paper", _EVERY_STEP, "peer_proxqp:ProxqpStageQP", "proxsuite"),
        "piqp_cascade": Contestant("cascade", {}, "peer_piqp:PiqpChainQP", "piqp"),
    }
)
"""`piqp_cascade` solves the cascade's three problems, the others without `cascade` the paper's one."""


def run(
    horizons: Sequence[int] = HORIZONS,
    steps: int = STEPS,
    seed: int = 0,
    progress: Progress = lambda _: None,
) -> dict[str, Any]:
    """Measure all contestants.

    Parameters
    ----------
    horizons
        Horizons N.
    steps
        Control steps of the recorded flight.
    seed
        Of the flight.
    progress
        Told in a line what is being done.

    Returns
    -------
    dict
        `horizons`: per horizon and solver `mean_ms`, `p99_ms`, `p999_ms`, `max_ms` of the whole step, and
        `error`, the largest distance of an input of the plan to the exact solution in scaled inputs
        (`error_median` its median over the steps; null without PIQP, which judges at 1e-9). `hard_steps`:
        steps whose plan has inputs on their limits, and `hard_mean_ms`, `hard_max_ms` of these alone.
        `early_stops`: steps on which a solver gave up. `missing`: contestants whose package is not installed.
    """
    present = {name: contestant for name, contestant in CONTESTANTS.items() if contestant.installed}
    flight = record_flight(COAXIAL_LAG, PERIOD_S, steps, seed)
    results = {}
    with _pinned():
        for horizon in horizons:
            progress(f"N = {horizon}: timing {', '.join(present)}")
            timed = _timed(present, horizon, flight)
            progress(f"N = {horizon}: distances to the exact solutions")
            for name, contestant in present.items():
                timed[name] |= _judged(contestant, horizon, flight)
            results[str(horizon)] = timed
    return {
        "horizons": results,
        "steps": steps,
        "seed": seed,
        "missing": sorted(set(CONTESTANTS) - set(present)),
        "machine": f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}",
    }


def _timed(
    present: Mapping[str, Contestant], horizon: int, flight: Sequence[Moment]
) -> dict[str, dict[str, Any]]:
    """Step all contestants through the flight in turn, beginning with another one at every step."""
    controllers = [(name, contestant.build(horizon)) for name, contestant in present.items()]
    taken: dict[str, list[float]] = {name: [] for name in present}
    hard: dict[str, list[bool]] = {name: [] for name in present}
    early = dict.fromkeys(present, 0)
    for _, controller in controllers:
        for moment in _reset(controller, flight)[:WARM_UP_STEPS]:
            controller.step(moment.estimate, moment.reference(PERIOD_S, horizon), moment.last_input)
        _reset(controller, flight)
    gc.collect()
    gc.disable()
    try:
        for number, moment in enumerate(flight):
            reference = moment.reference(PERIOD_S, horizon)
            turn = number % len(controllers)
            for name, controller in controllers[turn:] + controllers[:turn]:
                begun = time.thread_time_ns()
                step = controller.step(moment.estimate, reference, moment.last_input)
                taken[name].append(1e-6 * (time.thread_time_ns() - begun))
                early[name] += step.fallback is not None
                hard[name].append(_on_limits(step.inputs))
    finally:
        gc.enable()
    return {
        name: _figures(np.array(times))
        | _hard_figures(np.array(times)[np.array(hard[name])])
        | {"early_stops": early[name]}
        for name, times in taken.items()
    }


def _on_limits(inputs: Array) -> bool:
    at_limit = (inputs <= COAXIAL_LAG.u_min + ON_LIMIT) | (inputs >= COAXIAL_LAG.u_max - ON_LIMIT)
    return bool(at_limit.any())


def _reset(controller: Controller, flight: Sequence[Moment]) -> Sequence[Moment]:
    controller.reset(flight[0].estimate, flight[0].last_input)
    return flight


def _figures(times_ms: Array) -> dict[str, Any]:
    return {
        "mean_ms": round(float(times_ms.mean()), 4),
        "p99_ms": round(float(np.percentile(times_ms, 99.0)), 4),
        "p999_ms": round(float(np.percentile(times_ms, 99.9)), 4),
        "max_ms": round(float(times_ms.max()), 4),
    }


def _hard_figures(times_ms: Array) -> dict[str, Any]:
    table: dict[str, Any] = {"hard_steps": len(times_ms), "hard_mean_ms": None, "hard_max_ms": None}
    if len(times_ms):
        table["hard_mean_ms"] = round(float(times_ms.mean()), 4)
        table["hard_max_ms"] = round(float(times_ms.max()), 4)
    return table


def _judged(contestant: Contestant, horizon: int, flight: Sequence[Moment]) -> dict[str, float | None]:
    if find_spec("piqp") is None:
        return {"error": None, "error_median": None}
    errors: list[float] = []
    controller = contestant.build(horizon, errors)
    for moment in _reset(controller, flight):
        controller.step(moment.estimate, moment.reference(PERIOD_S, horizon), moment.last_input)
    return {"error": float(np.max(errors)), "error_median": float(np.median(errors))}


@contextmanager
def _pinned() -> Iterator[None]:
    """Stay on one processor."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
