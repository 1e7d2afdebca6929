"""Landing of a vehicle that does not follow its sticks."""

from rcopterx.agents.flight.vehicle_watch import HoverThrustLimits, VehicleFault, VehicleWatch
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array


class SelfCheck:
    """Watches one vehicle from take-off to landing."""

    def __init__(self, model: Model, limits: HoverThrustLimits, period_s: float) -> None:
        self._model = model
        self._watch = VehicleWatch(model, limits, period_s)
        self._watched_at_s = 0.0
        self.fault: VehicleFault | None = None
        """Why the vehicle lands, or has landed, by itself; None for no reason."""
        self.active = True
        """Whether the vehicle lands by itself."""

    @property
    def remark(self) -> str:
        """Fault or warning, for people; empty if there is none."""
        return self._watch.warning if self.fault is None else f"it lands: {self.fault.text}"

    @property
    def hover_thrust(self) -> float | None:
        """Share of the largest thrust at which the vehicle hovers; None before it is learnt in a flight."""
        return self._watch.hover_thrust

    def begin(self) -> None:
        """Begin a take-off."""
        self._watch.begin()
        self.fault = None

    def observe(
        self, command: Array, motion: Array, time_s: float, period_s: float, informative: bool
    ) -> VehicleFault | None:
        """Process a control period; return a fault that it reveals.

        A period is `informative` if the vehicle is seen and its controller flies it.
        """
        gap_s, self._watched_at_s = time_s - self._watched_at_s, time_s
        if not (self.active and informative) or self.fault is not None or gap_s > 1.5 * period_s:
            self._watch.forget()
            return None
        self.fault = self._watch.observe(command, motion)
        return self.fault

    def without_broken_axis(self, inputs: Array) -> Array:
        """Return inputs, shape (k, 4), that leave a broken axis at rest."""
        if self.fault is None or self.fault.axis is None:
            return inputs
        kept = inputs.copy()
        kept[:, self.fault.axis] = self._model.hover_input[self.fault.axis]
        return kept
