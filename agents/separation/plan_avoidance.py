"""Keeps the plan of one vehicle clear of the plans of others, as far as its controller can."""

from collections.abc import Mapping

from rcopterx.agents.guards.step_guard import StepGuard
from rcopterx.agents.separation.avoidance import Neighbour, SeparationEllipsoid, near
from rcopterx.control.interfaces import AvoidsObstacles, Controller, Obstacle
from rcopterx.control.references.trajectory import Trajectory


class PlanAvoidance:
    """Gives the controller of one vehicle the plans that come near."""

    def __init__(self, ellipsoid: SeparationEllipsoid | None, step_guard: StepGuard) -> None:
        self._ellipsoid = ellipsoid
        self._step_guard = step_guard
        self._unconstrained: Controller | None = None
        """Controller that is known to have no obstacles."""
        self.ticks = 0
        """Control periods in which separation constraints held the plan off another one."""
        self.closest_m: float | None = None
        """Smallest distance to another plan in any of them; None before the first."""

    def update(
        self,
        controller: Controller,
        neighbours: Mapping[str, Neighbour],
        plan: Trajectory | None,
        free: bool,
        delay_s: float,
    ) -> bool:
        """Update the obstacles of the controller; return False if plans touch and it avoids none.

        Parameters
        ----------
        plan
            Newest plan of the controller, if any.
        free
            Whether the vehicle can give way, which only free flight allows.
        delay_s
            From the present to the first stage of the plan.
        """
        obstacles: tuple[Obstacle, ...] = ()
        touching = False
        if neighbours and self._ellipsoid is not None and plan is not None and free:
            found = near(self._ellipsoid, neighbours, plan, controller.period_s, controller.horizon, delay_s)
            if self.closest_m is None or found.closest_m < self.closest_m:
                self.closest_m = found.closest_m
            obstacles, touching = found.obstacles, found.touching
        if not isinstance(controller, AvoidsObstacles):
            return not touching
        if obstacles or controller is not self._unconstrained:
            done = self._step_guard.try_call(controller, lambda: controller.set_obstacles(obstacles))
            self._unconstrained = controller if done and not obstacles else None
        self.ticks += touching
        return True
