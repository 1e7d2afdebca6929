"""Solver of quadratic programs with hard input bounds and soft state bounds, stage by stage.

Inside its bounds the problem is solved by one factorisation, which is kept as long as the matrices stay.
With bounds active, the first guess is that those of the previous solution are active again: one stage on,
because time has passed, or at the same stages, because a vehicle that cruises along a bound sees the same
problem at every step. Semismooth Newton steps on the augmented Lagrangian settle from one of the two guesses
in one to four factorisations. When they do not (a set point was moved), a primal-dual interior-point method
solves from scratch. When the time is over, the best of what is known is returned: the present iterate, or the
inputs of the previous plan.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.agents.controllers.chains.chain import INPUT_PENALTY, ActiveBounds, ChainTarget
from rcopterx.agents.controllers.chains.interior_point import InteriorPoint, StageProblem
from rcopterx.vehicles.state import Array

ACTIVE_SET_STEPS: Final = 5
SECOND_GUESS_STEPS: Final = 3
MULTIPLIER_STEPS: Final = 12
READABLE_GAPS: Final = (1e-2, 1e-4, 1e-6)
"""Mean complementarities at which the active bounds are read off an interior point; the last one is exact."""


def _never() -> bool:
    return False


def _nothing() -> None:
    return None


class Budget(Struct, frozen=True):
    """What a solve may take, and what it has to beat where that does not suffice.

    Attributes
    ----------
    expired
        Whether to stop; asked before every factorisation.
    planned
        Gives the inputs of the previous plan one stage on, shape (N - 1, m); None if there is none. Few
        solves ask for it.
    """

    expired: Callable[[], bool] = _never
    planned: Callable[[], Array | None] = _nothing


UNLIMITED: Final = Budget()


class ChainSolution(Struct, frozen=True):
    """What was found.

    Attributes
    ----------
    flat
        Positions y, shape (N + levels - 1, m), the first N of which are the stages'.
    inputs
        Shape (N - 1, m), within their bounds to `INPUT_TOLERANCE` if solved.
    solved
        False if the iterations or the time ran out.
    iterations
        Newton steps.
    """

    flat: Array
    inputs: Array
    solved: bool
    iterations: int


class ActiveSetQP:
    """Workspace of one problem.

    Parameters
    ----------
    chain
        The problem.
    max_iterations
        Interior-point steps after which the best point is returned unsolved.
    """

    def __init__(self, chain: StageProblem, max_iterations: int) -> None:
        self._chain = chain
        self._max_iterations = max_iterations
        self._weigh_bounds()
        self._active = ActiveBounds.none(chain.bounded.shape, chain.parameters.axes)
        self._presses = False
        """Whether any bound is active."""
        self._cruising = False
        self._factor: Array | None = None
        self._factor_side: Array | None = None
        """The active bounds that the factor is of; None for none."""
        self._warm = False
        """Whether there is a solution to begin from."""
        self._expired: Callable[[], bool] = _never

    def _weigh_bounds(self) -> None:
        chain = self._chain
        self._penalty: Array = chain.bounded * chain.soft_weights
        self._penalty[:, chain.inputs] = chain.bounded[:, chain.inputs] * INPUT_PENALTY

    def forget(self) -> None:
        """Start the next solve from nothing, also after one that was interrupted anywhere."""
        self._warm = self._cruising = self._presses = False
        self._active.clear()
        self._factor = self._factor_side = None

    def _solve(self, balance: Array, target: ChainTarget, budget: Budget) -> ChainSolution:
        """Solve with new numbers, from where the chain has begun.

        Parameters
        ----------
        balance
            What the rows of the inputs have added to them, shape (m,).
        target
            Reference and bounds.
        budget
            What it may take.

        Returns
        -------
        ChainSolution
            The minimiser, or the best point known: at most as costly as the planned inputs of the budget.
        """
        chain = self._chain
        self._expired = budget.expired
        if self._presses:
            solved, iterations = self._guess_twice(target)
        else:
            solved, iterations = self._active_set(target, ACTIVE_SET_STEPS)
        if not solved:
            solved, further = self._interior_point(target)
            iterations += further
        self._warm = True
        if solved:
            inputs = self._active.values[:-1, chain.inputs]
        else:
            known = [chain.values()[:-1, chain.inputs]]
            planned = budget.planned()
            if planned is not None:
                known.append(planned + balance)
            inputs = self._best(known, target)
        return ChainSolution(chain.positions(), inputs - balance, solved, iterations)

    def _best(self, known: list[Array], target: ChainTarget) -> Array:
        """Go to the least costly of these inputs, cut to their bounds."""
        chain = self._chain
        within = [np.clip(inputs, *self._input_bounds(target)) for inputs in known]
        costs = []
        for inputs in within:
            chain.roll_out(inputs)
            costs.append(self._cost_of(target))
        best = within[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
        if best is not within[-1]:
            chain.roll_out(best)
        return best

    def _cost_of(self, target: ChainTarget) -> float:
        """Cost of the present point, excesses over bounds included."""
        chain = self._chain
        values = chain.values()
        error = values - target.rows
        excess = np.maximum(values - target.upper, 0.0) + np.maximum(target.lower - values, 0.0)
        running = np.vdot(chain.weights * error, error) + np.vdot(self._penalty * excess, excess)
        return 0.5 * float(running) + chain.terminal_cost_of(target)

    def _guess_twice(self, target: ChainTarget) -> tuple[bool, int]:
        """Active-set steps from either guess, the one that was right last time first."""
        moved, same = self._active.moved_on(self._chain.bounded), self._active
        first, second = (same, moved) if self._cruising else (moved, same)
        start = self._chain.point()
        self._active = first.copy()
        solved, iterations = self._active_set(target, ACTIVE_SET_STEPS)
        if solved:
            return solved, iterations
        self._chain.restore(start)
        self._active, self._presses = second, True
        solved, further = self._active_set(target, SECOND_GUESS_STEPS)
        self._cruising = solved and not self._cruising
        return solved, iterations + further

    def _active_set(self, target: ChainTarget, most: int) -> tuple[bool, int]:
        """Semismooth Newton steps between multiplier updates; False if `most` of them do not settle.

        Steps that change no bound only bring the multipliers to where they belong. They need no new
        factorisation and are not counted against `most`.
        """
        chain, active = self._chain, self._active
        steps = changes = 0
        while changes < most and steps < MULTIPLIER_STEPS + most:
            factor = self._present_factor()
            if factor is None:
                return False, steps + 1
            left = MULTIPLIER_STEPS + most - steps
            further, solved, same = chain.settle(factor, target, self._penalty, active, left)
            steps += further
            if solved:
                return True, steps
            if not same:
                changes += 1
                self._presses = bool(active.side.any())
        return False, steps

    def _present_factor(self) -> Array | None:
        """Factor of the Hessian with the active bounds; None if there is none, or no time for a new one."""
        side = self._active.side if self._presses else None
        known = self._factor_side
        if self._factor is not None and (
            side is known if side is None or known is None else bool((side == known).all())
        ):
            return self._factor
        self._factor = None
        if self._expired():
            return None
        weights = self._chain.weights
        self._factor_side = None if side is None else side.copy()
        self._factor = self._chain.factorize(
            weights if side is None else np.where(side == 0.0, weights, weights + self._penalty)
        )
        return self._factor

    def _input_bounds(self, target: ChainTarget) -> tuple[Array, Array]:
        """Of the inputs of the horizon, which are the same at every stage."""
        columns = self._chain.inputs
        return target.lower[0, columns], target.upper[0, columns]

    def _interior_point(self, target: ChainTarget) -> tuple[bool, int]:
        """Interior-point steps until the active bounds can be read off and give the exact solution."""
        method = InteriorPoint(self._chain, target)
        for gap in READABLE_GAPS:
            closed = method.run(gap, self._max_iterations, self._expired)
            inside = self._chain.point()
            self._take_over(method)
            solved, _ = self._active_set(target, ACTIVE_SET_STEPS)
            if solved:
                return True, method.iterations
            self._chain.restore(inside)
            self._active.values[:] = self._chain.values()
            if not closed:
                break
        return closed, method.iterations

    def _take_over(self, method: InteriorPoint) -> None:
        """Active bounds and multipliers of an interior point."""
        pressing = method.multipliers > method.slacks
        self._active.side[:] = pressing[0].astype(float) - pressing[1]
        self._presses = bool(self._active.side.any())
        upper, lower = method.multipliers * pressing
        self._active.multipliers[:] = (upper - lower)[:, self._chain.inputs]
        self._factor = None
