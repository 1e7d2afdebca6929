"""Kernels of the horizontal problem (`rcopterx.control.controllers.chains.lateral_chain`).

The prediction x[i + 1] = A x[i] + B e[i] is the same at every stage, with n states and two demands. Rows of a
stage are position (inertial), velocity (body), stick, clearances: shape (N, 6 + K). Weights of rows make the
cost of a stage, so a Newton step is that of a linear-quadratic regulator: one Riccati recursion for the
feedback, which is the factor of the Hessian, and one pass back and forth for the step, both linear in N.
"""

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_BLOCKS,
    BLOCKS,
    FLAG,
    MATRIX,
    VECTOR,
    Array,
    compiled,
    part,
)


@part
def go_on(carried: Array, demand: Array, state: Array, x: float, y: float, after: Array) -> None:
    """Set the state after a period, of A transposed and B."""
    for row in range(len(state)):
        after[row] = demand[row, 0] * x + demand[row, 1] * y
    for column in range(len(state)):
        value = state[column]
        for row in range(len(state)):
            after[row] += carried[column, row] * value


@compiled(MATRIX, MATRIX, VECTOR, VECTOR, MATRIX)
def lateral_states(carried: Array, demand: Array, first: Array, demands: Array, states: Array) -> None:
    """Set the states that demands lead to; after the last one it goes on.

    Parameters
    ----------
    carried
        A transposed, shape (n, n).
    demand
        B, shape (n, 2).
    first
        State of the first stage, shape (n,).
    demands
        Shape (2 (N - 1),).
    states
        Shape (at least N, n).
    """
    last = len(demands) - 2
    for row in range(len(first)):
        states[0, row] = first[row]
    for stage in range(len(states) - 1):
        at = min(2 * stage, last)
        go_on(carried, demand, states[stage], demands[at], demands[at + 1], states[stage + 1])


@compiled(MATRIX, MATRIX, VECTOR, FLAG, VECTOR, MATRIX)
def lateral_begin(
    carried: Array, demand: Array, first: Array, shifted: bool, demands: Array, states: Array
) -> None:
    """Begin from the demands one stage on, or from none; arguments as in `lateral_states`."""
    for at in range(len(demands)):
        if not shifted:
            demands[at] = 0.0
        elif at + 2 < len(demands):
            demands[at] = demands[at + 2]
    lateral_states(carried, demand, first, demands, states)


@compiled(MATRIX, VECTOR, BLOCKS, BLOCKS, VECTOR, ANY_BLOCKS, MATRIX)
def lateral_rows(
    states: Array,
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
    states
        Position and velocity, inertial, and more, shape (at least N, n).
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
        x, y = states[stage, 0], states[stage, 1]
        rows[stage, 0], rows[stage, 1] = x, y
        v_x, v_y = states[stage, 2], states[stage, 3]
        c, s = turn[stage, 0, 0], turn[stage, 1, 0]
        rows[stage, 2], rows[stage, 3] = c * v_x + s * v_y, c * v_y - s * v_x
        rows[stage, 4] = rows[stage, 5] = 0.0
        if stage < stages - 1:
            e_x, e_y = demands[2 * stage], demands[2 * stage + 1]
            c, s = demand_turn[stage, 0, 0], demand_turn[stage, 1, 0]
            rows[stage, 4], rows[stage, 5] = (c * e_x + s * e_y) / gain[0], (c * e_y - s * e_x) / gain[1]
        for slot in range(slots):
            rows[stage, 6 + slot] = directions[stage, slot, 0] * x + directions[stage, slot, 1] * y


@part
def add_row_costs(cost: Array, weights: Array, turn: Array, directions: Array) -> None:
    """Add the weights of a stage's rows of the state to its cost, shape (n, n)."""
    cost[0, 0] += weights[0]
    cost[1, 1] += weights[1]
    for slot in range(len(directions)):
        weight, x, y = weights[6 + slot], directions[slot, 0], directions[slot, 1]
        cost[0, 0] += weight * x * x
        cost[0, 1] += weight * x * y
        cost[1, 0] += weight * x * y
        cost[1, 1] += weight * y * y
    c, s = turn[0, 0], turn[1, 0]
    mixed = c * s * (weights[2] - weights[3])
    cost[2, 2] += c * c * weights[2] + s * s * weights[3]
    cost[2, 3] += mixed
    cost[3, 2] += mixed
    cost[3, 3] += s * s * weights[2] + c * c * weights[3]


@part
def feedback_of(
    pushed: Array, later: Array, demand: Array, weights: Array, turn: Array, factor: Array
) -> bool:
    """Set K and (R + B' P B)^-1 of a stage beside each other; False if that matrix is not definite.

    Parameters
    ----------
    pushed, later
        P B and P A, shapes (n, 2) and (n, n).
    weights
        Of the two demands along the axes of the body, which `turn` turns into the inertial frame.
    """
    size = len(pushed)
    c, s = turn[0, 0], turn[1, 0]
    needed = np.empty((2, size + 2))
    for column in range(size):
        needed[0, column] = needed[1, column] = 0.0
    xx = yy = xy = 0.0
    # Along the axes of the body a large weight of one stick cannot drown what is known of the other.
    for row in range(size):
        x, y = c * demand[row, 0] + s * demand[row, 1], c * demand[row, 1] - s * demand[row, 0]
        p_x, p_y = c * pushed[row, 0] + s * pushed[row, 1], c * pushed[row, 1] - s * pushed[row, 0]
        xx += x * p_x
        xy += x * p_y
        yy += y * p_y
        for column in range(size):
            needed[0, column] += x * later[row, column]
            needed[1, column] += y * later[row, column]
    xx += weights[0]
    yy += weights[1]
    determinant = xx * yy - xy * xy
    if not (xx > 0.0 and determinant > 0.0):
        return False
    needed[0, size], needed[0, size + 1] = c, s
    needed[1, size], needed[1, size + 1] = -s, c
    for column in range(size + 2):
        x, y = needed[0, column], needed[1, column]
        along, across = (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant
        factor[0, column], factor[1, column] = c * along - s * across, s * along + c * across
    return True


@compiled(*6 * [MATRIX], BLOCKS, BLOCKS, VECTOR, ANY_BLOCKS, BLOCKS)
def lateral_factor(
    transition: Array,
    demand: Array,
    terminal: Array,
    endless: Array,
    usual: Array,
    weights: Array,
    turn: Array,
    demand_turn: Array,
    gain: Array,
    directions: Array,
    factor: Array,
) -> bool:
    """Riccati recursion from the last stage whose weights are not the usual ones.

    Parameters
    ----------
    transition, demand
        A and B.
    terminal
        Cost of the last state, shape (n, n): that of an endless horizon with the usual weights.
    endless
        Its feedback K and (R + B' P B)^-1, shape (2, n + 2).
    usual, weights
        Of the rows, shape (N, 6 + K).
    turn, demand_turn, gain, directions
        As in `lateral_rows`.
    factor
        Set to K and (R + B' P B)^-1 of the stages, shape (N - 1, 2, n + 2).

    Returns
    -------
    bool
        Whether the Hessian is definite.
    """
    stages, size = len(weights), len(transition)
    last = -1
    for stage in range(stages):
        for row in range(weights.shape[1]):
            if weights[stage, row] != usual[stage, row]:
                last = stage
    for stage in range(last + 1, stages - 1):
        for axis in range(2):
            for column in range(size + 2):
                factor[stage, axis, column] = endless[axis, column]
    cost = np.empty((size, size))
    for row in range(size):
        for column in range(size):
            cost[row, column] = terminal[row, column]
    if last == stages - 1:
        add_row_costs(cost, weights[last], turn[last], directions[last])
        last -= 1
    pushed, later = np.empty((size, 2)), np.empty((size, size))
    of_sticks = np.empty(2)
    for stage in range(last, -1, -1):
        for row in range(size):
            x = y = 0.0
            for column in range(size):
                later[row, column] = 0.0
            for inner in range(size):
                value = cost[row, inner]
                x += value * demand[inner, 0]
                y += value * demand[inner, 1]
                for column in range(size):
                    later[row, column] += value * transition[inner, column]
            pushed[row, 0], pushed[row, 1] = x, y
        for axis in range(2):
            of_sticks[axis] = weights[stage, 4 + axis] / gain[axis] ** 2
        here = factor[stage]
        if not feedback_of(pushed, later, demand, of_sticks, demand_turn[stage], here):
            return False
        # P (A - B K), then A' times that, of which one half is enough.
        for row in range(size):
            for column in range(size):
                later[row, column] -= pushed[row, 0] * here[0, column] + pushed[row, 1] * here[1, column]
        for row in range(size):
            for column in range(row + 1):
                cost[row, column] = 0.0
            for inner in range(size):
                value = transition[inner, row]
                for column in range(row + 1):
                    cost[row, column] += value * later[inner, column]
            for column in range(row):
                cost[column, row] = cost[row, column]
        add_row_costs(cost, weights[stage], turn[stage], directions[stage])
    return True


@compiled(
    MATRIX, MATRIX, MATRIX, BLOCKS, MATRIX, VECTOR, BLOCKS, BLOCKS, VECTOR, ANY_BLOCKS, VECTOR, MATRIX
)  # fmt: skip
def lateral_step(
    transition: Array,
    carried: Array,
    demand: Array,
    factor: Array,
    pull: Array,
    terminal_pull: Array,
    turn: Array,
    demand_turn: Array,
    gain: Array,
    directions: Array,
    step: Array,
    moved: Array,
) -> None:
    """Newton step of the demands from a point.

    Parameters
    ----------
    transition, carried, demand
        A transposed is `carried`; the others as in `lateral_states`.
    factor
        Of `lateral_factor`.
    pull, terminal_pull
        Derivatives of the cost by the rows, and of the terminal cost by the last state, shape (n,).
    turn, demand_turn, gain, directions
        As in `lateral_rows`.
    step, moved
        Set to it, shape (2 (N - 1),), and to the states' change, shape (at least N, n).
    """
    stages, size = len(turn), len(transition)
    costate, before = np.empty(size), np.empty(size)
    for row in range(size):
        costate[row] = terminal_pull[row]
    for stage in range(stages - 1, -1, -1):
        if stage < stages - 1:
            forward, left = pull[stage, 4] / gain[0], pull[stage, 5] / gain[1]
            c, s = demand_turn[stage, 0, 0], demand_turn[stage, 1, 0]
            x, y = c * forward - s * left, s * forward + c * left
            for row in range(size):
                x += demand[row, 0] * costate[row]
                y += demand[row, 1] * costate[row]
            here = factor[stage]
            step[2 * stage] = -here[0, size] * x - here[0, size + 1] * y
            step[2 * stage + 1] = -here[1, size] * x - here[1, size + 1] * y
            for column in range(size):
                before[column] = -here[0, column] * x - here[1, column] * y
            for row in range(size):
                value = costate[row]
                for column in range(size):
                    before[column] += transition[row, column] * value
            costate, before = before, costate
        x, y = pull[stage, 0], pull[stage, 1]
        for slot in range(directions.shape[1]):
            x += directions[stage, slot, 0] * pull[stage, 6 + slot]
            y += directions[stage, slot, 1] * pull[stage, 6 + slot]
        c, s = turn[stage, 0, 0], turn[stage, 1, 0]
        costate[0] += x
        costate[1] += y
        costate[2] += c * pull[stage, 2] - s * pull[stage, 3]
        costate[3] += s * pull[stage, 2] + c * pull[stage, 3]
    for row in range(size):
        moved[0, row] = 0.0
    for stage in range(len(moved) - 1):
        at = min(stage, stages - 2)
        if stage < stages - 1:
            here = factor[stage]
            for axis in range(2):
                total = step[2 * stage + axis]
                for column in range(size):
                    total -= here[axis, column] * moved[stage, column]
                step[2 * stage + axis] = total
        go_on(carried, demand, moved[stage], step[2 * at], step[2 * at + 1], moved[stage + 1])
