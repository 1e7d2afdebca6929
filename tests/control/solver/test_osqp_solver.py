"""Promises of OSQP in the place of the default solver: the same plans, also of whole controllers."""

from copy import deepcopy

import numpy as np
import pytest
from problems import one_stage_on, random_problem
from support.vehicle_types import COAXIAL, COAXIAL_LAG

from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.solver.osqp import OsqpSolver
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Solution
from rcopterx.control.solver.riccati import RiccatiSolver
from rcopterx.vehicles.model import Model
from rcopterx_studies.baselines.paper import PaperController, PaperSettings
from rcopterx_studies.benchmarks.flight import record_flight

PERIOD_S = 0.02


class Recording(RiccatiSolver):
    """The default solver, which keeps the problems it is given."""

    def __init__(self, problems: list[OptimalControlProblem]) -> None:
        super().__init__()
        self._problems = problems

    def solve(self, p: OptimalControlProblem, *arguments: object, **options: object) -> Solution:
        self._problems.append(deepcopy(p))
        return super().solve(p, *arguments, **options)  # type: ignore[arg-type]  # passed on as they are


@pytest.mark.parametrize("model", [COAXIAL, COAXIAL_LAG], ids=["tilt", "lags"])
@pytest.mark.parametrize("scheme", ["cascade", "paper"])
def test_both_solvers_return_the_same_plan_on_problems_of_a_flight(model: Model, scheme: str) -> None:
    problems: list[OptimalControlProblem] = []

    def new_solver() -> Recording:
        return Recording(problems)

    controller: CascadeController | PaperController
    if scheme == "paper":
        controller = PaperController(model, PERIOD_S, PaperSettings(horizon=20), new_solver)
    else:
        controller = CascadeController(model, PERIOD_S, CascadeSettings(horizon=20), new_solver)
    flight = record_flight(model, PERIOD_S, 500, 0)
    for moment in flight[::50]:
        controller.reset(moment.estimate, moment.last_input)
        controller.step(moment.estimate, moment.reference(PERIOD_S, 20), moment.last_input)
    assert len(problems) >= 10
    for p in problems:
        ours, osqp = RiccatiSolver().solve(p), OsqpSolver(1e-8, time_limit_s=20.0).solve(p)
        assert ours.optimal
        sticks = p.s == HARD
        assert ours.y[sticks] == pytest.approx(osqp.y[sticks], abs=2e-4)


@pytest.mark.parametrize(
    "settings",
    [CascadeSettings(solver="osqp", time_limit_s=1.0), PaperSettings(solver="osqp", time_limit_s=1.0)],
)
def test_the_settings_of_every_mpc_controller_name_the_solver(
    settings: CascadeSettings | PaperSettings,
) -> None:
    kind = CascadeController if isinstance(settings, CascadeSettings) else PaperController
    moment = record_flight(COAXIAL, PERIOD_S, 1, 0)[0]
    steps = []
    for chosen in (settings, type(settings)()):
        controller = kind(COAXIAL, PERIOD_S, chosen)  # type: ignore[arg-type]  # settings of the same kind
        controller.reset(moment.estimate, moment.last_input)
        steps.append(controller.step(moment.estimate, moment.reference(PERIOD_S, 50), moment.last_input))
    assert steps[0].inputs[0] == pytest.approx(steps[1].inputs[0], abs=0.02)
    assert steps[0].iterations > steps[1].iterations


def test_it_starts_warm_and_takes_problems_of_other_shapes() -> None:
    solver, p = OsqpSolver(time_limit_s=10.0), random_problem(20, 1)
    cold = solver.solve(p).iterations
    warm = solver.solve(one_stage_on(p, RiccatiSolver().solve(p).u[0])).iterations
    assert warm <= cold
    other = random_problem(10, 2)
    assert solver.solve(other).u == pytest.approx(RiccatiSolver().solve(other).u, abs=0.01)


def test_a_solver_out_of_time_returns_sticks_within_their_bounds() -> None:
    p = random_problem(60, 4, stick=0.2)
    plan = OsqpSolver(1e-9, time_limit_s=1e-5).solve(p)
    assert not plan.optimal
    assert np.isfinite(plan.u).all()
    assert (np.abs(plan.y[p.s == HARD]) <= 0.2 + 1e-9).all()
