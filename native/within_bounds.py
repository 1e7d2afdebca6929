"""Kernel of a control step of the cascade in which no bound is active, for vehicles with a tilt model.

It takes the same kernels in the same order as a step that Python leads from problem to problem
(`rcopterx.agents.controllers.cascade.controller`).
"""

# Arguments that are passed on in one piece cannot be counted.
# mypy: disable-error-code="call-arg"

from typing import Any, Final

from rcopterx.native.cascade import STEADY, STEADY_BEGIN, steady_problem
from rcopterx.native.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    MATRIX,
    TARGET,
    VECTOR,
    Array,
    compiled,
    part,
    together,
)
from rcopterx.native.lateral_problem import TILTED, TURNS, lateral_problem
from rcopterx.native.plans import JOINING, join_plans
from rcopterx.native.settling import (
    CHAIN,
    FACTOR_OF_CHAIN,
    FACTOR_OF_LATERAL,
    LATERAL,
    PLAN,
    SHIFTED,
    chain_attempt,
    lateral_attempt,
)

POINT: Final = together(VECTOR, MATRIX, MATRIX)
STEADY_STEP: Final = together(
    together(*STEADY),
    together(*STEADY_BEGIN),
    together(*TARGET),
    together(*CHAIN),
    POINT,
    together(*FACTOR_OF_CHAIN),
    together(*PLAN),
)
LATERAL_STEP: Final = together(
    together(*TILTED),
    VECTOR,
    together(*TURNS),
    together(*TARGET),
    together(*LATERAL),
    POINT,
    together(*FACTOR_OF_LATERAL),
    together(*PLAN),
)


@part
def undo(before: Array, point: Any) -> None:
    """Go back to positions or demands at which nothing pressed."""
    present, side, multipliers = point
    for at in range(len(before)):
        present[at] = before[at]
    for stage in range(len(side)):
        for row in range(side.shape[1]):
            side[stage, row] = 0.0
        for axis in range(multipliers.shape[1]):
            multipliers[stage, axis] = 0.0


@compiled(*7 * [ANY_VECTOR], ANY_MATRIX, STEADY_STEP, LATERAL_STEP, together(*JOINING), MATRIX, MATRIX)
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
        Of the vertical and of yaw: what `steady_problem` knows of the vehicle; reference that is cut, first
        state and load; target; what `chain_attempt` knows; the point, which is among that: positions, sides
        and multipliers; the factor without active bounds; plan.
    lateral
        Of the horizontal motion: what `lateral_problem` knows of the vehicle; first state; turns; target;
        what `lateral_attempt` knows; the point: demands, sides and multipliers; factor; plan.
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
    vehicle, (aim, first, load), target, problem, point, factor, (flat, steady_inputs) = steady
    if not steady_problem(motion, actuator, disturbance, samples, *vehicle, aim, first, load, *target):
        return 0
    before = point[0].copy()
    steps, solved, _, _ = chain_attempt(
        *problem, first, load, SHIFTED, *factor, False, *target, 1, flat, steady_inputs
    )
    if not solved:
        undo(before, point)
        return 0
    tilted, state, turns, aimed, horizontal, demands, feedback, (way, sticks) = lateral
    lateral_problem(
        motion, core, servo, wind, trim, aim, flat[:, 1], *tilted, state, *turns, *aimed,
    )  # fmt: skip
    demanded = demands[0].copy()
    further, solved, _, _ = lateral_attempt(
        *horizontal, state, trim, SHIFTED, *feedback, False, *aimed, 1, way, sticks
    )
    if not solved:
        undo(before, point)
        undo(demanded, demands)
        return 0
    join_plans(way, flat, sticks, steady_inputs, actuator, *joining, inputs, planned)
    return steps + further
