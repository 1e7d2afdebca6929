"""Computing time of a whole control step, side by side with peers on the same problems.

Every contestant is a complete controller: checking, formulation in numpy, solving, plan. Its solver gets the
problems of a recorded flight of the default vehicle, three of the cascade or the one of the paper. All are
stepped in turn, in one process on one processor, so that whatever disturbs the machine disturbs all alike.
Times are the thread's processor time.
"""

import gc
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.interfaces import Controller
from rcopterx.control.solver.osqp import OsqpSolver
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Solution, Solver
from rcopterx.control.solver.riccati import RiccatiSolver
from rcopterx.fleet.vehicle_types import vehicle_type
from rcopterx.vehicles.model import Model
from rcopterx_studies.baselines.paper import PaperController, PaperSettings
from rcopterx_studies.benchmarks.flight import Moment, record_flight
from rcopterx_studies.benchmarks.peers import EXACT, PIQP, PiqpMultistage, PiqpSparse
from rcopterx_studies.benchmarks.processes import Show

COAXIAL: Final = vehicle_type("coaxial").model
COAXIAL_LAG: Final = vehicle_type("coaxial_lag").model
PERIOD_S: Final = 0.02
WARM_UP_STEPS: Final = 20
EVERY: Final = 10  # one problem in so many is judged
ON_LIMIT: Final = 1e-6  # an input this close to a limit is on it
SAMPLING_MS: Final = 20.0
OURS: Final = {"cascade": "-", "cascade_lags": "--"}  # lines of our own, thick and black


@dataclass(frozen=True, slots=True)
class Contestant:
    """A controller of a vehicle with a solver."""

    solver: Callable[[], Solver]  # solver of the optimal control problems
    model: Model = COAXIAL  # the vehicle
    controller: str = "cascade"  # `cascade` or `paper`
    package: str | None = None  # what must be installed

    @property
    def installed(self) -> bool:
        """Whether its package is installed."""
        return self.package is None or find_spec(self.package) is not None

    def build(self, horizon: int, solver: Callable[[], Solver] | None = None) -> Controller:
        """Return the controller, with its own solver or another one."""
        chosen = solver or self.solver
        if self.controller == "paper":
            return PaperController(self.model, PERIOD_S, PaperSettings(horizon=horizon), chosen)
        return CascadeController(self.model, PERIOD_S, CascadeSettings(horizon=horizon), chosen)


def _osqp() -> Solver:
    return OsqpSolver(time_limit_s=1.0)  # it stops by the clock, which runs while other processes run


CONTESTANTS: Final[Mapping[str, Contestant]] = MappingProxyType(
    {
        "cascade": Contestant(RiccatiSolver),
        "cascade_lags": Contestant(RiccatiSolver, COAXIAL_LAG),
        "paper": Contestant(RiccatiSolver, controller="paper"),
        "osqp": Contestant(_osqp),
        "osqp_paper": Contestant(_osqp, controller="paper"),
        "piqp_sparse": Contestant(PiqpSparse, package=PIQP),
        "piqp_multistage": Contestant(PiqpMultistage, package=PIQP),
    }
)
"""`cascade` is the default; peers solve its three problems, `paper` and `osqp_paper` the one of the paper."""


class JudgedSolver:
    """A solver; `errors` gets the distance of its sticks from the exact solution of each tenth problem."""

    def __init__(self, solver: Solver, errors: list[float]) -> None:
        self._solver, self._errors, self._count = solver, errors, 0
        self._judge = PiqpSparse(EXACT)

    def reset(self) -> None:
        """Start the next solve cold."""
        self._solver.reset()

    def solve(self, p: OptimalControlProblem, same_cost: bool, expired: Callable[[], bool]) -> Solution:
        """Solve a problem, and judge the plan."""
        plan = self._solver.solve(p, same_cost, expired)
        self._count += 1
        if self._count % EVERY == 1:
            exact = self._judge.solve(p)
            sticks = p.s == HARD
            given = np.clip(plan.y, p.low, p.high)[sticks]
            self._errors.append(float(np.abs(given - exact.y[sticks]).max()))
        return plan


def run(horizons: Sequence[int], steps: int, seed: int, show: Show) -> dict[str, Any]:
    """Measure all contestants.

    `steps` and `seed` are of the recorded flight. Returns `horizons`: per horizon and solver `mean_ms`,
    `p99_ms`, `p999_ms`, `max_ms` of the whole step, and `error`, the largest distance of a stick of the plan
    to the exact solution (`error_median` its median over the steps; null without PIQP, which judges at 1e-9).
    `hard_steps`: steps whose plan has inputs on their limits, and `hard_mean_ms`, `hard_max_ms` of these
    alone. `missing`: contestants whose package is not installed.
    """
    present = {name: contestant for name, contestant in CONTESTANTS.items() if contestant.installed}
    flights = {model.kind: record_flight(model, PERIOD_S, steps, seed) for model in (COAXIAL, COAXIAL_LAG)}
    results = {}
    with _pinned():
        for horizon in horizons:
            show(f"N = {horizon}: timing {', '.join(present)}")
            timed = _timed(present, horizon, flights)
            show(f"N = {horizon}: distances to the exact solutions")
            for name, contestant in present.items():
                timed[name] |= _judged(contestant, horizon, flights[contestant.model.kind])
            results[str(horizon)] = timed
    return {
        "horizons": results,
        "steps": steps,
        "seed": seed,
        "missing": sorted(set(CONTESTANTS) - set(present)),
        "machine": f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}",
    }


def _timed(
    present: Mapping[str, Contestant], horizon: int, flights: Mapping[str, Sequence[Moment]]
) -> dict[str, dict[str, Any]]:
    """Step all contestants through their flights in turn, beginning with another one at every step."""
    taken: dict[str, list[tuple[float, bool]]] = {name: [] for name in present}
    u_min, u_max = COAXIAL_LAG.u_min + ON_LIMIT, COAXIAL_LAG.u_max - ON_LIMIT
    flown = []
    for name, contestant in present.items():
        controller, flight = contestant.build(horizon), flights[contestant.model.kind]
        for moment in _reset(controller, flight)[:WARM_UP_STEPS]:
            controller.step(moment.estimate, moment.reference(PERIOD_S, horizon), moment.last_input)
        flown.append((name, controller, _reset(controller, flight)))
    gc.collect()
    gc.disable()
    try:
        for number in range(len(flown[0][2])):
            turn = number % len(flown)
            for name, controller, flight in flown[turn:] + flown[:turn]:
                moment = flight[number]
                reference = moment.reference(PERIOD_S, horizon)
                begun = time.thread_time_ns()
                step = controller.step(moment.estimate, reference, moment.last_input)
                time_ms = 1e-6 * (time.thread_time_ns() - begun)
                hard = bool(((step.inputs <= u_min) | (step.inputs >= u_max)).any())
                taken[name].append((time_ms, hard))
    finally:
        gc.enable()
    return {name: _figures(steps) for name, steps in taken.items()}


def _reset(controller: Controller, flight: Sequence[Moment]) -> Sequence[Moment]:
    controller.reset(flight[0].estimate, flight[0].last_input)
    return flight


def _figures(steps: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """Figures of control steps: time [ms], whether inputs are on their limits."""
    times_ms, hard = np.array(steps).T
    hard_ms = times_ms[hard == 1.0]
    p99_ms, p999_ms = np.percentile(times_ms, (99.0, 99.9))
    return {
        "mean_ms": round(float(times_ms.mean()), 4),
        "p99_ms": round(float(p99_ms), 4),
        "p999_ms": round(float(p999_ms), 4),
        "max_ms": round(float(times_ms.max()), 4),
        "hard_steps": len(hard_ms),
        "hard_mean_ms": round(float(hard_ms.mean()), 4) if len(hard_ms) else None,
        "hard_max_ms": round(float(hard_ms.max()), 4) if len(hard_ms) else None,
    }


def _judged(contestant: Contestant, horizon: int, flight: Sequence[Moment]) -> dict[str, float | None]:
    if find_spec(PIQP) is None:
        return {"error": None, "error_median": None}
    errors: list[float] = []
    controller = contestant.build(horizon, lambda: JudgedSolver(contestant.solver(), errors))
    for moment in _reset(controller, flight):
        controller.step(moment.estimate, moment.reference(PERIOD_S, horizon), moment.last_input)
    return {"error": float(np.max(errors)), "error_median": float(np.median(errors))}


@contextmanager
def _pinned() -> Iterator[None]:
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def draw_solver(document: Mapping[str, Any], figure: Any) -> None:
    """Draw mean and 99.9th percentile of the whole control step of every solver."""
    figure.set_size_inches(11, 5)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    horizons = document["horizons"]
    lengths = [int(length) for length in horizons]
    for name in next(iter(horizons.values())):
        own = {"color": "black", "linestyle": OURS[name], "linewidth": 2.2} if name in OURS else {}
        for axes, field in ((left, "mean_ms"), (right, "p999_ms")):
            values = [horizons[str(length)][name][field] for length in lengths]
            axes.plot(lengths, values, marker="o", markersize=4, label=name, **own)
    for axes, title in ((left, "mean"), (right, "99.9th percentile")):
        axes.axhline(SAMPLING_MS, color="grey", linestyle="--")
        axes.set(title=title, xlabel="horizon N", yscale="log")
        axes.grid(alpha=0.3, which="both")
    left.set_ylabel("whole control step [ms], dashed: sampling time")
    left.legend(fontsize="small", ncols=2)
    figure.tight_layout()
