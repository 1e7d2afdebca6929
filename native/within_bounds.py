"""Kernel of a control step of the cascade in which no bound is active, for vehicles with a tilt model.

It takes the same kernels in the same order as a step that Python leads from problem to problem
(`rcopterx.control.controllers.cascade.controller`).
"""

# Arguments that are passed on in one piece cannot be counted.
# mypy: disable-error-code="call-arg"

from typing import Any, Final

import numpy as np

from rcopterx.compiling.compiled import ANY_MATRIX, ESTIMATE, MATRIX, Array, compiled, part, together
from rcopterx.native.cascade import STEADY, steady_problem
from rcopterx.native.lateral_problem import TILTED, lateral_problem
from rcopterx.native.plans import JOINING, join_plans
from rcopterx.native.settling import (
    CHAIN,
    CHAIN_MULTIPLIERS,
    CHAIN_SIDE,
    DEMAND_TURN,
    DEMANDS,
    FACTOR_OF_CHAIN,
    FACTOR_OF_LATERAL,
    FLAT,
    LATERAL,
    LATERAL_MULTIPLIERS,
    LATERAL_SIDE,
    SHIFTED,
    STATES,
    TURN,
    chain_attempt,
    lateral_attempt,
)

STEADY_STEP: Final = together(together(*STEADY), together(*CHAIN), together(*FACTOR_OF_CHAIN))
LATERAL_STEP: Final = together(together(*TILTED), together(*LATERAL), together(*FACTOR_OF_LATERAL))


@part
def empty_target(stages: int, states: int) -> tuple[Array, Array, Array, Array]:
    """Room for reference, last state and bounds of a problem of two axes."""
    return np.empty((stages, 6)), np.empty(states), np.empty((1, 6)), np.empty((1, 6))


@part
def undo(before: Array, present: Array, side: Array, multipliers: Array) -> None:
    """Go back to positions or demands at which nothing pressed."""
    for at in range(len(before)):
        present[at] = before[at]
    for stage in range(len(side)):
        for row in range(side.shape[1]):
            side[stage, row] = 0.0
        for axis in range(multipliers.shape[1]):
            multipliers[stage, axis] = 0.0


@compiled(*ESTIMATE, ANY_MATRIX, STEADY_STEP, LATERAL_STEP, together(*JOINING), MATRIX, MATRIX)
def step_within_bounds(
    motion: Array,
    actuator: Array,
    disturbance: Array,
    core: Array,
    servo: Array,
    wind: Array,
    trim: Array,
    samples: Array,
    steady: Any,
    lateral: Any,
    joining: Any,
    inputs: Array,
    planned: Array,
) -> int:
    """Solve the problems of a control step one stage on from the last one, if no bound becomes active.

    Parameters
    ----------
    motion, actuator, disturbance, core, servo, wind, trim
        The estimate.
    samples
        The reference, shape (N, 12).
    steady
        Of the vertical and of yaw: what `steady_problem` knows of the vehicle, what `chain_attempt` knows of
        the problem, and the factor without active bounds.
    lateral
        Of the horizontal motion: the same for `lateral_problem` and `lateral_attempt`.
    joining
        What `join_plans` knows of the vehicle.
    inputs, planned
        Set to inputs and plan, as by `join_plans`.

    Returns
    -------
    int
        Number of Newton steps. Zero if a bound becomes active or the measured climb or yaw rate is beyond its
        bounds; both problems are then at the points at which they were.
    """
    stages = len(samples)
    vehicle, chain, factor = steady
    flat = chain[FLAT]
    levels = len(flat) // 2 - stages
    aim, first, load = np.empty(samples.shape), np.empty((levels, 2)), np.empty(2)
    target = empty_target(stages, 2 * levels)
    if not steady_problem(motion, actuator, disturbance, samples, *vehicle, aim, first, load, *target):
        return 0
    before = flat.copy()
    climb, steady_inputs = np.empty((stages + levels - 1, 2)), np.empty((stages - 1, 2))
    steps, solved, _, _ = chain_attempt(
        *chain, first, load, SHIFTED, *factor, False, *target, 1, climb, steady_inputs
    )
    if not solved:
        undo(before, flat, chain[CHAIN_SIDE], chain[CHAIN_MULTIPLIERS])
        return 0
    tilted, horizontal, feedback = lateral
    demands, reach = horizontal[DEMANDS], horizontal[STATES].shape
    state, aimed = np.empty(reach[1]), empty_target(stages, reach[1])
    turns = horizontal[TURN], horizontal[DEMAND_TURN]
    lateral_problem(
        motion, core, servo, wind, trim, aim, climb[:, 1], *tilted, state, *turns, *aimed,
    )  # fmt: skip
    demanded = demands.copy()
    way, sticks = np.empty((reach[0], 2)), np.empty((stages - 1, 2))
    further, solved, _, _ = lateral_attempt(
        *horizontal, state, trim, SHIFTED, *feedback, False, *aimed, 1, way, sticks
    )
    if not solved:
        undo(before, flat, chain[CHAIN_SIDE], chain[CHAIN_MULTIPLIERS])
        undo(demanded, demands, horizontal[LATERAL_SIDE], horizontal[LATERAL_MULTIPLIERS])
        return 0
    join_plans(way, climb, sticks, steady_inputs, actuator, *joining, inputs, planned)
    return steps + further
