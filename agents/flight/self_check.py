"""Whether the vehicle does what its sticks ask, and what is flown when it does not."""

from rcopterx.agents.flight.vehicle_watch import HoverThrustLimits, VehicleFault, VehicleWatch
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array


class SelfCheck:
    """Watches one vehicle from take-off to landing.

    Parameters
    ----------
    model
        The vehicle.
    limits
        When the battery counts as empty.
    period_s
        Control period.

    Attributes
    ----------
    fault
        Why the vehicle lands, or has landed, without being asked to.
    active
        Whether the vehicle lands by itself when it does not do what it is told.
    """

    def __init__(self, model: Model, limits: HoverThrustLimits, period_s: float) -> None:
        self._model = model
        self._watch = VehicleWatch(model, limits, period_s)
        self._watched_at_s = 0.0
        self.fault: VehicleFault | None = None
        self.active = True

    @property
    def remark(self) -> str:
        """What people should know; empty if there is nothing."""
        return self._watch.warning if self.fault is None else f"it lands: {self.fault.text}"

    @property
    def hover_thrust(self) -> float | None:
        """Share of the largest thrust at which the vehicle hovers; None before it is learnt in a flight."""
        return self._watch.hover_thrust

    def begin(self) -> None:
        """A take-off begins."""
        self._watch.begin()
        self.fault = None

    def observe(
        self, command: Array, motion: Array, time_s: float, period_s: float, telling: bool
    ) -> VehicleFault | None:
        """Take in a control period.

        Parameters
        ----------
        command
            Input that is sent, shape (4,).
        motion
            Estimated state.
        time_s, period_s
            Present moment, and time between control periods.
        telling
            Whether the period tells something: the vehicle is seen, and its controller flies it.

        Returns
        -------
        VehicleFault or None
            A fault that was found now.
        """
        gap_s, self._watched_at_s = time_s - self._watched_at_s, time_s
        if not (self.active and telling) or self.fault is not None or gap_s > 1.5 * period_s:
            self._watch.forget()
            return None
        self.fault = self._watch.observe(command, motion)
        return self.fault

    def without_broken_axis(self, inputs: Array) -> Array:
        """Inputs that leave an axis at rest which does not obey, shape (k, 4)."""
        if self.fault is None or self.fault.axis is None:
            return inputs
        kept = inputs.copy()
        kept[:, self.fault.axis] = self._model.hover_input[self.fault.axis]
        return kept
