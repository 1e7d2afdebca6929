"""Kernels of the horizontal problem (`rcopterx.agents.controllers.chains.lateral_chain`).

Rows of a stage are position (inertial), velocity (body), stick, clearances: shape (N, 6 + K).
"""

from rcopterx.native.compiled import ANY_BLOCKS, COUNT, MATRIX, VECTOR, Array, compiled


@compiled(VECTOR, VECTOR, ANY_BLOCKS, ANY_BLOCKS, VECTOR, ANY_BLOCKS, MATRIX)
def lateral_rows(
    moved: Array,
    demands: Array,
    turn: Array,
    demand_turn: Array,
    gain: Array,
    directions: Array,
    rows: Array,
) -> None:
    """Set the rows of the stages, shape (N, 6 + K).

    Parameters
    ----------
    moved
        Positions of the stages, then velocities, inertial, shape (at least 4 N,).
    demands
        Shape (2 (N - 1),).
    turn, demand_turn
        R(psi) of stages and of periods, shapes (N, 2, 2) and (N - 1, 2, 2).
    gain
        Demand per stick, shape (2,).
    directions
        Of the clearances, shape (N, K, 2).
    """
    stages, slots = len(turn), directions.shape[1]
    for stage in range(stages):
        x, y = moved[2 * stage], moved[2 * stage + 1]
        rows[stage, 0], rows[stage, 1] = x, y
        v_x, v_y = moved[2 * (stages + stage)], moved[2 * (stages + stage) + 1]
        c, s = turn[stage, 0, 0], turn[stage, 1, 0]
        rows[stage, 2], rows[stage, 3] = c * v_x + s * v_y, c * v_y - s * v_x
        rows[stage, 4] = rows[stage, 5] = 0.0
        if stage < stages - 1:
            e_x, e_y = demands[2 * stage], demands[2 * stage + 1]
            c, s = demand_turn[stage, 0, 0], demand_turn[stage, 1, 0]
            rows[stage, 4], rows[stage, 5] = (c * e_x + s * e_y) / gain[0], (c * e_y - s * e_x) / gain[1]
        for slot in range(slots):
            rows[stage, 6 + slot] = directions[stage, slot, 0] * x + directions[stage, slot, 1] * y


@compiled(MATRIX, ANY_BLOCKS, ANY_BLOCKS, VECTOR, ANY_BLOCKS, VECTOR, VECTOR)
def lateral_pull(
    pull: Array,
    turn: Array,
    demand_turn: Array,
    gain: Array,
    directions: Array,
    moved: Array,
    demands: Array,
) -> None:
    """Transpose of `lateral_rows`.

    Parameters
    ----------
    pull
        Derivative by the rows.
    moved
        Set to the derivative by the positions, then velocities, but for entries beyond these.
    demands
        Set to the derivative by the demands as far as they are sticks, shape (2 (N - 1),).
    """
    stages = len(turn)
    for stage in range(stages):
        x, y = pull[stage, 0], pull[stage, 1]
        for slot in range(directions.shape[1]):
            x += directions[stage, slot, 0] * pull[stage, 6 + slot]
            y += directions[stage, slot, 1] * pull[stage, 6 + slot]
        moved[2 * stage], moved[2 * stage + 1] = x, y
        forward, left = pull[stage, 2], pull[stage, 3]
        c, s = turn[stage, 0, 0], turn[stage, 1, 0]
        moved[2 * (stages + stage)] = c * forward - s * left
        moved[2 * (stages + stage) + 1] = s * forward + c * left
        if stage < stages - 1:
            forward, left = pull[stage, 4] / gain[0], pull[stage, 5] / gain[1]
            c, s = demand_turn[stage, 0, 0], demand_turn[stage, 1, 0]
            demands[2 * stage], demands[2 * stage + 1] = c * forward - s * left, s * forward + c * left


@compiled(MATRIX, MATRIX, ANY_BLOCKS, VECTOR, COUNT)
def add_stick_weights(hessian: Array, added: Array, demand_turn: Array, gain: Array, first: int) -> None:
    """Add to a Hessian by the demands what weights of the sticks add: R W R' of each stage.

    Parameters
    ----------
    hessian
        Shape (2 (N - 1), 2 (N - 1)), changed in place.
    added
        Additional weights of the rows, whose sticks begin at `first`.
    """
    for stage in range(len(demand_turn)):
        weight_x, weight_y = added[stage, first] / gain[0] ** 2, added[stage, first + 1] / gain[1] ** 2
        if weight_x != 0.0 or weight_y != 0.0:
            c, s = demand_turn[stage, 0, 0], demand_turn[stage, 1, 0]
            at = 2 * stage
            hessian[at, at] += c * c * weight_x + s * s * weight_y
            hessian[at + 1, at + 1] += s * s * weight_x + c * c * weight_y
            mixed = c * s * (weight_x - weight_y)
            hessian[at, at + 1] += mixed
            hessian[at + 1, at] += mixed
