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
from typing import Any, Final, Generic, TypeVar

import numpy as np
from msgspec import Struct

from rcopterx.control.controllers.chains.chain import Chain, ChainTarget
from rcopterx.control.controllers.chains.interior_point import InteriorPoint
from rcopterx.control.controllers.chains.lateral_chain import LateralChain
from rcopterx.native.bounds import move_bounds_on
from rcopterx.native.settling import AFRESH, GO_ON, SHIFTED
from rcopterx.vehicles.state import Array

ACTIVE_SET_STEPS: Final = 5
SECOND_GUESS_STEPS: Final = 3
MULTIPLIER_STEPS: Final = 12
Start = tuple[Array, Array]
"""State of stage 1, and what the inputs balance."""
SomeChain = TypeVar("SomeChain", Chain, LateralChain)
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


class ActiveSetQP(Generic[SomeChain]):
    """Workspace of one problem.

    Parameters
    ----------
    chain
        The problem.
    max_iterations
        Interior-point steps after which the best point is returned unsolved.
    """

    def __init__(self, chain: SomeChain, max_iterations: int) -> None:
        self.chain: SomeChain = chain
        self._max_iterations = max_iterations
        self._active = chain.active
        self._presses = False
        """Whether any bound is active."""
        self._cruising = False
        self._free, self._pressed = chain.unknown_factor(bounds=False), chain.unknown_factor(bounds=True)
        """Factors without active bounds and with some."""
        self._plan = self._new_plan()
        self._warm = False
        """Whether there is a solution to begin from."""
        self.settled = False
        """Whether there is one at which no bound is active, and the factor of such a problem is known."""
        self._expired: Callable[[], bool] = _never

    def forget(self) -> None:
        """Start the next solve from nothing, also after one that was interrupted anywhere."""
        self._warm = self._cruising = self._presses = False
        self._active.clear()
        self._forget_factors()

    def _forget_factors(self) -> None:
        self._free.stale = self._pressed.stale = True
        self.settled = False

    def _new_plan(self) -> tuple[Array, Array]:
        """Room for positions and inputs."""
        positions_shape, inputs_shape = self.chain.plan_shapes
        return np.empty(positions_shape), np.empty(inputs_shape)

    @property
    def settled_problem(self) -> tuple[Any, ...]:
        """Problem and factor, as `rcopterx.native.within_bounds` takes them."""
        return self.chain.problem, (self._free.numbers, self._free.side)

    def solve(
        self, first_state: Array, load: Array, target: ChainTarget, budget: Budget = UNLIMITED
    ) -> ChainSolution:
        """Solve with new numbers, starting from the last solution shifted by one stage.

        Parameters
        ----------
        first_state
            State of stage 1, as `begin` of the chain takes it.
        load
            What acts at every stage and inputs balance (`balance` of the chain), shape (m,).
        target
            Reference and bounds; inputs with the balance added.
        budget
            What it may take.

        Returns
        -------
        ChainSolution
            The minimiser, or the best point known: at most as costly as the planned inputs of the budget.
        """
        self._plan = self._new_plan()
        self._expired = budget.expired
        begin = SHIFTED if self._warm else AFRESH
        start = first_state, load
        if self._presses:
            solved, iterations = self._guess_twice(start, begin, target)
        else:
            solved, iterations = self._active_set(start, begin, target, ACTIVE_SET_STEPS)
        if not solved:
            solved, further = self._interior_point(start, target)
            iterations += further
        self._warm = True
        self.settled = not (self._presses or self._free.stale)
        if not solved:
            self._go_to_best(load, target, budget.planned())
        positions, inputs = self._plan
        return ChainSolution(positions, inputs, solved, iterations)

    def _take_point(self, inputs: Array, load: Array) -> None:
        """Plan the present point, where inputs, balance added, are these."""
        self._plan = self.chain.positions(), inputs - self.chain.balance(load)

    def _go_to_best(self, load: Array, target: ChainTarget, planned: Array | None) -> None:
        """Plan the less costly of the present point and planned inputs."""
        chain = self.chain
        known = [chain.values()[:-1, chain.inputs]]
        if planned is not None:
            known.append(planned + chain.balance(load))
        self._take_point(self._best(known, target), load)

    def _best(self, known: list[Array], target: ChainTarget) -> Array:
        """Go to the least costly of these inputs, cut to their bounds."""
        chain = self.chain
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
        chain = self.chain
        values = chain.values()
        error = values - target.rows
        excess = np.maximum(values - target.upper, 0.0) + np.maximum(target.lower - values, 0.0)
        running = np.vdot(chain.weights * error, error) + np.vdot(chain.penalty * excess, excess)
        return 0.5 * float(running) + chain.terminal_cost_of(target)

    def _guess_twice(self, start: Start, begin: int, target: ChainTarget) -> tuple[bool, int]:
        """Active-set steps from either guess, the one that was right last time first."""
        chain, active = self.chain, self._active
        point, side, multipliers = chain.point(), active.side.copy(), active.multipliers.copy()
        if not self._cruising:
            move_bounds_on(active.side, active.multipliers, chain.bounded)
        solved, iterations = self._active_set(start, begin, target, ACTIVE_SET_STEPS)
        if solved:
            return solved, iterations
        chain.restore(point)
        active.side[:], active.multipliers[:] = side, multipliers
        if self._cruising:
            move_bounds_on(active.side, active.multipliers, chain.bounded)
        self._presses = True
        solved, further = self._active_set(start, begin, target, SECOND_GUESS_STEPS)
        self._cruising = solved and not self._cruising
        return solved, iterations + further

    def _active_set(self, start: Start, begin: int, target: ChainTarget, most: int) -> tuple[bool, int]:
        """Semismooth Newton steps between multiplier updates; False if `most` of them do not settle.

        Steps that change no bound only bring the multipliers to where they belong. They need no new
        factorisation and are not counted against `most`.

        Parameters
        ----------
        start
            Measured state, and what the inputs balance.
        begin
            Whether to begin there, or to go on (`rcopterx.native.settling`).
        """
        chain, limit = self.chain, MULTIPLIER_STEPS + most
        steps = changes = 0
        while changes < most and steps < limit:
            presses = self._presses
            factor = self._pressed if presses else self._free
            if (presses or factor.stale) and self._expired():
                if begin != GO_ON:
                    chain.begin(*start, begin == SHIFTED)
                return False, steps + 1
            further, solved, same, self._presses = chain.attempt(
                *chain.problem,
                *start,
                begin,
                factor.numbers,
                factor.side,
                factor.stale,
                *target,
                limit - steps,
                *self._plan,
            )
            factor.stale = further == 0
            if solved:
                return True, steps + further
            if factor.stale:
                return False, steps + 1
            begin = GO_ON
            steps += further
            if not same:
                changes += 1
        return False, steps

    def _input_bounds(self, target: ChainTarget) -> tuple[Array, Array]:
        """Of the inputs of the horizon, which are the same at every stage."""
        columns = self.chain.inputs
        return target.lower[0, columns], target.upper[0, columns]

    def _interior_point(self, start: Start, target: ChainTarget) -> tuple[bool, int]:
        """Interior-point steps until the active bounds can be read off and give the exact solution."""
        chain = self.chain
        method = InteriorPoint(chain, target)
        for gap in READABLE_GAPS:
            closed = method.run(gap, self._max_iterations, self._expired)
            inside = chain.point()
            self._take_over(method)
            solved, _ = self._active_set(start, GO_ON, target, ACTIVE_SET_STEPS)
            if solved:
                return True, method.iterations
            chain.restore(inside)
            if not closed:
                break
        if closed:
            self._take_point(chain.values()[:-1, chain.inputs], start[1])
        return closed, method.iterations

    def _take_over(self, method: InteriorPoint) -> None:
        """Active bounds and multipliers of an interior point."""
        pressing = method.multipliers > method.slacks
        self._active.side[:] = pressing[0].astype(float) - pressing[1]
        self._presses = bool(self._active.side.any())
        upper, lower = method.multipliers * pressing
        self._active.multipliers[:] = (upper - lower)[:, self.chain.inputs]
