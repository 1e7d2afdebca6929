"""Gain of errors along a formation: how gusts on vehicles move those that follow, at all frequencies.

Every vehicle is its own controller around hover, differentiated numerically: inputs and plan by the state
and by the reference over the whole horizon. Estimates are exact, and plans are those of the same frame. A
follower refers to a share of the deviation of its leaders' plans from their nominal trajectories.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from graphlib import TopologicalSorter
from typing import Any, Final

import numpy as np

from rcopterx.bus.requests import Tune
from rcopterx.control.interfaces import Controller, Estimate, TiltEstimate
from rcopterx.control.models.linear import Complex
from rcopterx.control.models.prediction import predict
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.deploy.roles.agent import configured
from rcopterx.fleet.formation_check import links_of
from rcopterx.fleet.schema import FleetFile, errors_at
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.formation.topology import ancestors
from rcopterx.ground_station.terminal.margins import unknown_loops
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE, XD_BODY, YD_BODY, Array, Z

FREQUENCIES_HZ: Final = np.geomspace(0.2, 10.0, 25)
LARGEST_AMPLIFICATION: Final = 1.5  # of errors along a formation; more is beyond the limit
_SMALL: Final = 1e-4
_HORIZONTAL: Final = np.array([0, 1, 4, 5, 8, 9])  # horizontal columns of a trajectory


@dataclass(frozen=True)
class LinearVehicle:
    """A vehicle with n states; references and plans have 6 N horizontal numbers."""

    transition: Array  # of the states over a control period, with the feedback, shape (n, n)
    drive: Array  # of the reference on the states, shape (n, 6 N)
    plan: Array  # of the states on the plan, shape (6 N, n)
    copied: Array  # of the reference on the plan, shape (6 N, 6 N)
    period_s: float

    def settled(self, z: complex) -> Complex:
        """Response of the states to what is added to them in each period, at one frequency."""
        return np.asarray(np.linalg.inv(z * np.eye(len(self.transition)) - self.transition))

    @cached_property
    def passed_on(self) -> float:
        """Largest spectral radius, over all frequencies, of the reference's effect on the plan.

        Times the copied share it must not exceed one, or deviations grow along a line.
        """
        largest = 0.0
        for z in np.exp(2j * np.pi * FREQUENCIES_HZ * self.period_s):
            on_plan: Any = self.plan @ (self.settled(z) @ self.drive) + self.copied
            largest = max(largest, float(np.abs(np.linalg.eigvals(on_plan)).max()))
        return largest


def linear_vehicle(model: Model, controller: Controller) -> LinearVehicle:
    """Differentiate a controller around hover, where it must be linear and without integrators."""
    period_s, stages = controller.period_s, controller.horizon
    core = 0 if model.tilt is None else model.tilt.dynamics().size
    hovering = np.zeros(MOTION_SIZE + 4 + (core + 2 if core else 0))
    hovering[Z] = 1.0
    hovering[MOTION_SIZE : MOTION_SIZE + 4] = model.hover_input
    still = hold(hovering[:3], 0.0, period_s, stages).samples

    def step(state: Array, samples: Array) -> Array:
        estimate = _estimate(state, core)
        controller.reset(estimate, model.hover_input)
        found = controller.step(estimate, Trajectory(samples, period_s), model.hover_input)
        return np.concatenate((found.inputs[0], found.plan.samples[:, _HORIZONTAL].ravel()))

    def moved(state: Array, value: Array) -> Array:
        return _state(predict(model, _estimate(state, core), value, period_s))

    def referring(change: Array) -> Array:
        samples = still.copy()
        samples[:, _HORIZONTAL] += change.reshape(stages, -1)
        return step(hovering, samples)

    inputs = step(hovering, still)[:4]
    by_state = _slopes(lambda change: step(hovering + change, still), len(hovering))
    by_reference = _slopes(referring, stages * len(_HORIZONTAL))
    A = _slopes(lambda change: moved(hovering + change, inputs), len(hovering))
    B = _slopes(lambda change: moved(hovering, inputs + change), len(inputs))
    return LinearVehicle(A + B @ by_state[:4], B @ by_reference[:4], by_state[4:], by_reference[4:], period_s)


def _slopes(function: Callable[[Array], Array], size: int) -> Array:
    """Jacobian by central differences, shape (m, size)."""
    columns = [(function(row) - function(-row)) / (2 * _SMALL) for row in _SMALL * np.eye(size)]
    return np.array(columns).T


def _estimate(state: Array, core: int) -> Estimate:
    motion, actuator, tilt = np.split(state, (MOTION_SIZE, MOTION_SIZE + 4))
    if not core:
        return Estimate(motion.copy(), actuator.copy(), np.zeros(4))
    known = TiltEstimate(tilt[:core].copy(), tilt[core:].copy(), np.zeros(2), np.zeros(2))
    return Estimate(motion.copy(), actuator.copy(), np.zeros(4), known)


def _state(estimate: Estimate) -> Array:
    tilt = estimate.tilt
    return np.concatenate((estimate.motion, estimate.actuator, tilt.core, tilt.servo))


def amplifications(
    vehicles: Mapping[str, LinearVehicle],
    leaders: Mapping[str, Mapping[str, float]],
    shares: Mapping[str, float],
) -> dict[str, float]:
    """Return the amplification of errors along a formation, by vehicle.

    It is the peak over all frequencies of the horizontal error by independent gusts on the vehicle and on all
    above it, relative to that of a gust on the vehicle alone.

    `leaders`: weights of the leaders of each vehicle, which add up to one; none for a head. `shares`: share
    of the deviations of its leaders that each vehicle copies.
    """
    order = {name: place for place, name in enumerate(TopologicalSorter(leaders).static_order())}
    peaks = {name: np.zeros(2) for name in order}
    for frequency_hz in FREQUENCIES_HZ:
        plans: dict[str, Complex] = {}
        for name, place in order.items():
            vehicle = vehicles[name]
            z = np.exp(2j * np.pi * frequency_hz * vehicle.period_s)
            reference = np.zeros((len(vehicle.copied), 2 * len(order)), dtype=complex)
            for leader, weight in leaders[name].items():
                reference += shares[name] * weight * plans[leader]
            pushes = np.zeros((len(vehicle.transition), 2 * len(order)), dtype=complex)
            pushes[[XD_BODY, YD_BODY], [2 * place, 2 * place + 1]] = 1.0
            states = vehicle.settled(z) @ (vehicle.drive @ reference + pushes)
            plans[name] = vehicle.plan @ states + vehicle.copied @ reference
            gains = np.linalg.norm(states[:2].reshape(2, -1, 2), 2, axis=(0, 2))
            peaks[name] = np.maximum(peaks[name], (gains[place] ** 2, np.sum(gains**2)))
    return {name: float(np.sqrt(together / alone)) for name, (alone, together) in peaks.items()}


def formation_amplifications(file: FleetFile) -> dict[str, Any]:
    """Growth of errors along the formation of a fleet file, as a JSON document.

    It has `vehicles` by name with the number of vehicles `above`, the share of deviations that is `passed_on`
    from each vehicle to the next and the amplification of errors `together`, `limit`, and `beyond`, the
    vehicles beyond the limit; where a vehicle's controller is not known, `vehicles` is null
    and `unknown` says why. Raises FleetError for a setting that is not allowed.
    """
    unknown = next(
        (f"{name}: {why}" for name in file.vehicles if (why := unknown_loops(configured(file, name)))), None
    )
    document: dict[str, Any] = {"fleet": file.name, "limit": LARGEST_AMPLIFICATION, "unknown": unknown}
    if unknown is not None:
        return document | {"vehicles": None, "beyond": []}
    links, known = links_of(file), dict[tuple[object, ...], LinearVehicle]()
    leaders = {
        name: {link.leader: link.weight / sum(each.weight for each in own) for link in own}
        for name, own in links.items()
    }
    shares = {name: vehicle.control.deviation_share for name, vehicle in file.vehicles.items()}
    vehicles = {name: _linear_vehicle(file, name, known) for name in file.vehicles}
    together = amplifications(vehicles, leaders, shares)
    table = {
        name: {
            "above": len(ancestors(links, name)),
            "passed_on": shares[name] * vehicles[name].passed_on if own else 0.0,
            "together": together[name],
        }
        for name, own in links.items()
    }
    beyond = [name for name, found in table.items() if not found["together"] <= LARGEST_AMPLIFICATION]
    return document | {"vehicles": table, "beyond": beyond}


def _linear_vehicle(
    file: FleetFile, name: str, known: dict[tuple[object, ...], LinearVehicle]
) -> LinearVehicle:
    """Return a vehicle's linear behaviour; vehicles that are configured alike have the same one."""
    model, period_s = model_of(file, name), file.vehicles[name].control.period_s
    configuration = configured(file, name).changed(Tune(controller_settings={"integrators": False}))
    key = (model, period_s, repr(configuration))
    if key not in known:
        with errors_at(f"vehicles.{name}.control", ValueError):
            known[key] = linear_vehicle(model, configuration.controller_for(model, period_s))
    return known[key]
