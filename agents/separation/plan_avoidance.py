"""Keeps the plan of one vehicle clear of the plans of others, as far as its controller can."""

from collections.abc import Mapping

from rcopterx.agents.guards.step_guard import StepGuard
from rcopterx.agents.separation.avoidance import Neighbour, SeparationEllipsoid, near
from rcopterx.control.interfaces import AvoidsObstacles, Controller, Obstacle
from rcopterx.control.references.trajectory import Trajectory


class PlanAvoidance:
    """Tells the controller of one vehicle who comes near.

    Parameters
    ----------
    ellipsoid
        Around the vehicle, that no other one is to enter; None for no avoidance.
    step_guard
        Through which the controller is told.

    Attributes
    ----------
    ticks
        Control periods in which separation constraints held the plan off another one.
    closest_m
        Smallest distance to another plan in any of them; None before the first.
    """

    def __init__(self, ellipsoid: SeparationEllipsoid | None, step_guard: StepGuard) -> None:
        self._ellipsoid = ellipsoid
        self._step_guard = step_guard
        self._controller: Controller | None = None
        self._avoiding: AvoidsObstacles | None = None
        self._told = True
        """Whether the controller may believe that somebody is near."""
        self.ticks = 0
        self.closest_m: float | None = None

    def use(self, controller: Controller) -> None:
        """Tell another controller from now on."""
        self._controller, self._told = controller, True
        self._period_s, self._stages = controller.period_s, controller.horizon
        self._avoiding = controller if isinstance(controller, AvoidsObstacles) else None

    def update(
        self, neighbours: Mapping[str, Neighbour], plan: Trajectory | None, free: bool, delay_s: float
    ) -> bool:
        """Look at the plans of others once in a control period.

        Parameters
        ----------
        neighbours
            Vehicles that may come near.
        plan
            Newest plan of the own controller, if any.
        free
            Whether there is anywhere to go, which only free flight offers.
        delay_s
            From the present to the first stage of the plan.

        Returns
        -------
        bool
            False if plans touch and the controller avoids nothing.
        """
        controller, avoiding = self._controller, self._avoiding
        if controller is None:
            return True
        obstacles: tuple[Obstacle, ...] = ()
        touching = False
        if neighbours and self._ellipsoid is not None and plan is not None and free:
            found = near(self._ellipsoid, neighbours, plan, self._period_s, self._stages, delay_s)
            if self.closest_m is None or found.closest_m < self.closest_m:
                self.closest_m = found.closest_m
            obstacles, touching = found.obstacles, found.touching
        if avoiding is None:
            return not touching
        if obstacles or self._told:
            heard = self._step_guard.try_call(controller, lambda: avoiding.set_obstacles(obstacles))
            self._told = bool(obstacles) or not heard
        self.ticks += touching
        return True
