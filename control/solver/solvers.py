"""The solvers by name."""

from collections.abc import Callable
from typing import Final, Literal, Protocol

from rcopterx.control.solver.problem import OptimalControlProblem, Plan
from rcopterx.control.solver.riccati import RiccatiSolver

SolverName = Literal["riccati", "osqp"]
DEFAULT_SOLVER: Final[SolverName] = "riccati"


class Solver(Protocol):
    """Solves one problem after another, warm-started by the last one."""

    def reset(self) -> None:
        """Start the next solve cold."""
        ...

    def solve(self, p: OptimalControlProblem, same_cost: bool, expired: Callable[[], bool]) -> Plan:
        """Solve a problem, one stage after the last one.

        Parameters
        ----------
        p
            The problem.
        same_cost
            Whether A, B, P and the rows with weights are those of the last solve.
        expired
            Deadline, after which the best plan known is returned.
        """
        ...


def make_solver(name: SolverName, max_iterations: int, time_limit_s: float) -> Solver:
    """Return a new solver."""
    if name == "osqp":
        from rcopterx.control.solver.osqp import OsqpSolver  # needs a library that the default does not load

        return OsqpSolver(time_limit_s=time_limit_s)
    return RiccatiSolver(max_iterations)
