"""Recordings of vehicles that are exactly what a model says, in wind and with noise."""

import math

import numpy as np

from rcopterx.control.identification.excitation import Excitation, excitation_for
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.lateral import POSITION, VELOCITY, LateralSystem
from rcopterx.control.models.prediction import predict
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import heading_matrix
from support.demand import demand_matrix

PERIOD_S = 0.02


def simulated_flight(
    model: Model,
    duration_s: float = 30.0,
    excitation: Excitation | None = None,
    trim: tuple[float, float] = (0.01, -0.02),
    body_rad: tuple[float, float] = (0.03, -0.04),
    seed: int = 1,
    gust_density: float = 0.0,
) -> FlightRecording:
    """Sticks of a multisine without a controller, one period of delay, wind, and noise of a motion capture.

    Nothing holds the vehicle in its place, which a linear model does not mind.
    """
    assert model.tilt is not None
    excitation = excitation or excitation_for(model, duration_s)
    random = np.random.default_rng(seed)
    system = LateralSystem(model, PERIOD_S)
    rows = round(duration_s / PERIOD_S)
    late = round(model.delay_s / PERIOD_S)
    lateral, upright = np.zeros(system.size), Estimate(np.zeros(8), model.hover_input, np.zeros(4))
    gust, push, fade = np.zeros(2), np.zeros(4), math.exp(-PERIOD_S / 0.5)
    strength = math.sqrt(1.0 - fade**2)
    position, yaw, tilt, inputs = (
        np.zeros((rows, 3)),
        np.zeros(rows),
        np.zeros((rows, 2)),
        np.zeros((rows, 4)),
    )
    for row in range(rows):
        heading_rad = float(upright.motion[3])
        position[row, :2] = lateral[POSITION] + model.lever_arm_m * lateral[system.tilt]
        position[row, 2] = upright.motion[2]
        yaw[row] = heading_rad
        tilt[row] = lateral[system.tilt] + heading_matrix(heading_rad) @ np.array(body_rad)
        inputs[row] = model.hover_input + excitation.at(row * PERIOD_S)
        acting = inputs[max(row - late, 0)]
        gust = fade * gust + strength * 0.1 * random.standard_normal(2)
        push = fade * push + strength * np.array([0.0, 0.0, 0.05, 0.2]) * random.standard_normal(4)
        lateral[system.wind] = gust
        upright = predict(model, Estimate(upright.motion, upright.actuator, push), acting, PERIOD_S)
        middle_rad = 0.5 * (heading_rad + float(upright.motion[3]))
        demand = demand_matrix(model, middle_rad) @ (acting[:2] + np.array(trim))
        lateral = system.transition @ lateral + system.demand @ demand
        if gust_density:
            lateral[VELOCITY] += gust_density * math.sqrt(PERIOD_S) * random.standard_normal(2)
    return FlightRecording(
        model.kind,
        PERIOD_S,
        position + 0.0003 * random.standard_normal(position.shape),
        yaw + 0.002 * random.standard_normal(rows),
        tilt + 0.002 * random.standard_normal(tilt.shape),
        inputs,
    )


def still_flight(model: Model, duration_s: float = 30.0) -> FlightRecording:
    """The same with sticks that do not move."""
    return simulated_flight(model, duration_s, Excitation((0.0, 0.0, 0.0, 0.0), duration_s))
