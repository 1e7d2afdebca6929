"""Distances of a solver's inputs to the exact solution of its problem."""

from typing import Any, Final

import numpy as np

from rcopterx.benchmarks.peer_piqp import ExactChainQP, ExactStageQP
from rcopterx.control.controllers.chains.active_set import UNLIMITED, Budget, ChainSolution
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.control.controllers.paper.stage_qp import StageQP, StageSolution
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

EVERY: Final = 10
"""Interval of the judged steps."""


def judged_stage(base: type[StageQP], errors: list[float]) -> type[StageQP]:
    """Class like `base` that appends the distance of its inputs (which are scaled) to `errors`."""

    class Judged(base):  # type: ignore[valid-type,misc]  # the base is a parameter
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self._judge = ExactStageQP(*arguments)
            self._count = 0

        def set_dynamics(self, dynamics: Array) -> None:
            super().set_dynamics(dynamics)
            self._judge.set_dynamics(dynamics)

        def set_terminal_cost(self, terminal_cost: Array) -> None:
            super().set_terminal_cost(terminal_cost)
            self._judge.set_terminal_cost(terminal_cost)

        def solve(self, *problem: Any) -> StageSolution | None:
            found: StageSolution | None = super().solve(*problem)
            self._count += 1
            if self._count % EVERY == 1:
                exact = self._judge.solve(*problem)
                if found is None or exact is None or not exact.solved:
                    raise RuntimeError("a problem of the benchmark was not solved")
                lower, upper = problem[-1]
                given = np.clip(found.inputs, lower, upper)
                errors.append(float(np.abs(given - exact.inputs).max()))
            return found

    return Judged


def judged_chain(base: type[ChainQP], errors: list[float], model: Model) -> type[ChainQP]:
    """Class like `base` that appends the distance of its inputs, scaled, to `errors`."""
    scales = dict(zip(model.input_gain, model.input_scale, strict=True))

    class Judged(base):  # type: ignore[valid-type,misc]  # the base is a parameter
        def __init__(self, parameters: ChainParameters, max_iterations: int) -> None:
            super().__init__(parameters, max_iterations)
            self._judge = ExactChainQP(parameters, max_iterations)
            self._scale = np.array([scales[gain] for gain in parameters.gain])
            self._count = 0

        def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
            super().set_matrices(turn, transition, terminal_cost)
            self._judge.set_matrices(turn, transition, terminal_cost)

        def solve(
            self, first_state: Array, disturbance: Array, target: ChainTarget, budget: Budget = UNLIMITED
        ) -> ChainSolution:
            found: ChainSolution = super().solve(first_state, disturbance, target, budget)
            self._count += 1
            if self._count % EVERY == 1:
                exact = self._judge.solve(first_state, disturbance, target)
                if not exact.solved:
                    raise RuntimeError("a problem of the benchmark was not solved")
                errors.append(float(np.abs((found.inputs - exact.inputs) / self._scale).max()))
            return found

    return Judged
