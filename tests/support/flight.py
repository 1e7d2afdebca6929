"""A vehicle to fly in tests: it behaves exactly as its model says and stands on a floor."""

from collections import deque
from collections.abc import Callable

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.control.interfaces import ControlStep, Estimate, Measurement, never
from rcopterx.control.models.prediction import predict
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import YAW, Array
from support.records import replace
from support.vehicle_types import COAXIAL_LAG

REST = np.zeros(4)


def still(position_m: tuple[float, float, float] = (0.0, 0.0, 0.0), yaw_rad: float = 0.0) -> Estimate:
    """A vehicle at rest with its rotor off."""
    return Estimate(np.array([*position_m, yaw_rad, 0.0, 0.0, 0.0, 0.0]), REST, REST)


def measured(estimate: Estimate) -> Measurement:
    """What an undisturbed motion capture sees of a vehicle."""
    turned = (estimate.motion[YAW] + np.pi) % (2 * np.pi) - np.pi
    return Measurement(estimate.motion[:3].copy(), float(turned))


class Plant:
    """A vehicle whose inputs act `model.delay_s` after they were sent."""

    def __init__(
        self,
        model: Model = COAXIAL_LAG,
        start: Estimate | None = None,
        floor_m: float | None = 0.0,
        acting: Array = REST,
    ) -> None:
        self.model = model
        self.state = still() if start is None else start
        self.time_s = 0.0
        self._floor_m = floor_m
        self._acting = acting
        self._under_way: deque[tuple[float, Array]] = deque()

    @property
    def on_floor(self) -> bool:
        return self._floor_m is not None and bool(self.state.motion[2] <= self._floor_m + 1e-9)

    def send(self, value: Array) -> None:
        self._under_way.append((self.time_s + self.model.delay_s, value.copy()))

    def advance(self, period_s: float) -> None:
        end_s = self.time_s + period_s
        while self._under_way and self._under_way[0][0] < end_s - 1e-9:
            at_s, value = self._under_way.popleft()
            self._pass(at_s - self.time_s)
            self._acting = value
        self._pass(end_s - self.time_s)
        self.time_s = end_s

    def _pass(self, duration_s: float) -> None:
        if duration_s <= 1e-12:
            return
        moved = predict(self.model, self.state, self._acting, duration_s)
        self.time_s += duration_s
        if self._floor_m is not None and moved.motion[2] < self._floor_m:
            # The floor stops it and holds it.
            place = self.state.motion[:4].copy()
            place[2] = self._floor_m
            moved = replace(moved, motion=np.concatenate((place, REST)))
        self.state = moved


class ExactEstimator:
    """Knows the first pose and the model, and needs nothing else."""

    def __init__(self, model: Model = COAXIAL_LAG) -> None:
        self._model = model
        self._estimate = still()
        self.resets = 0

    def reset(self, measurement: Measurement) -> None:
        self.resets += 1
        x, y, z = measurement.position_m
        self._estimate = still((x, y, z), measurement.yaw_rad)

    def take_over(self, estimate: Estimate) -> None:
        self._estimate = estimate

    def predict(self, applied_input: Array, period_s: float) -> None:
        self._estimate = predict(self._model, self._estimate, applied_input, period_s)

    def correct(self, measurement: Measurement) -> bool:
        return True

    @property
    def estimate(self) -> Estimate:
        return self._estimate


class NotedController:
    """Plays given inputs and records its calls."""

    def __init__(self, inputs: Array, period_s: float = 0.02, horizon: int = 8) -> None:
        self._inputs = inputs
        self.period_s = period_s
        self.horizon = horizon
        self.asked: list[tuple[Estimate, Trajectory, Array]] = []
        self.resets: list[tuple[Estimate, Array]] = []
        self.fallback: str | None = None

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        self.resets.append((estimate, last_input))

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        self.asked.append((estimate, reference, last_input))
        first = (len(self.asked) - 1) % len(self._inputs)
        rows = [self._inputs[(first + row) % len(self._inputs)] for row in range(self.horizon - 1)]
        plan = hold(estimate.motion[:3], float(estimate.motion[YAW]), self.period_s, self.horizon)
        return ControlStep(np.array(rows), plan, self.fallback, 1)


def assert_sound(flight: ControlOutput, model: Model) -> None:
    """A command is finite and within the limits of its vehicle, whatever happened."""
    for inputs in (flight.input[None, :], flight.next_inputs):
        assert np.isfinite(inputs).all()
        assert (inputs >= model.u_min - 1e-9).all()
        assert (inputs <= model.u_max + 1e-9).all()
    assert np.isfinite(flight.plan.samples).all()


class Lab:
    """A pilot and its plant on one clock: poses come every `period_s`, the transmitter is always armed."""

    def __init__(self, pilot: Pilot, plant: Plant, frame_period_s: float = 0.02, per_tick: int = 1) -> None:
        self.pilot = pilot
        self.plant = plant
        self.frame = 0
        self.state = "armed"
        self.flights: list[ControlOutput] = []
        self._frame_period_s = frame_period_s
        self._per_tick = per_tick

    def see(self, visible: bool = True) -> None:
        """Let the pilot see the present, and control where a control period begins."""
        measurement = measured(self.plant.state) if visible else None
        self.pilot.observe(StampedMeasurement(1, self.frame, self._frame_period_s, measurement))
        if self.frame % self._per_tick == 0:
            flight = self.pilot.control({})
            assert_sound(flight, self.pilot.model)
            self.flights.append(flight)
            self.plant.send(flight.input)
            self.pilot.note_applied(self.state, self.pilot.sequence, flight.input)

    def tick(self, visible: bool = True) -> None:
        """One frame: see, act, and let the time pass."""
        self.see(visible)
        self.plant.advance(self._frame_period_s)
        self.frame += 1

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self._frame_period_s)):
            self.tick()
