"""Kernels of the chains of integrators (`rcopterx.control.controllers.chains.chain`)."""

import math

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    BLOCKS,
    COUNT,
    FLAG,
    MATRIX,
    NUMBER,
    VECTOR,
    Array,
    compiled,
    part,
)


@compiled(BLOCKS, VECTOR, COUNT, MATRIX)
def chain_values(rows: Array, flat: Array, axes: int, values: Array) -> None:
    """Rows of the stages times the windows of the positions.

    Parameters
    ----------
    rows
        Shape (N, r, w).
    flat
        Positions, stage by stage, shape (at least (N - 1) m + w,).
    axes
        m.
    values
        Set to them, shape (N, r).
    """
    stages, count, width = rows.shape
    for stage in range(stages):
        begin = stage * axes
        for row in range(count):
            total = 0.0
            for place in range(width):
                total += rows[stage, row, place] * flat[begin + place]
            values[stage, row] = total


@part
def chain_gradient(rows: Array, pull: Array, axes: int, gradient: Array) -> None:
    """Set the derivative of sum(pull * rows) with respect to all positions, shape ((N - 1) m + w,)."""
    stages, count, width = rows.shape
    for place in range(len(gradient)):
        gradient[place] = 0.0
    for stage in range(stages):
        begin = stage * axes
        for row in range(count):
            factor = pull[stage, row]
            if factor != 0.0:
                for place in range(width):
                    gradient[begin + place] += factor * rows[stage, row, place]


@part
def add_terminal_gradient(
    gradient: Array, flat: Array, terminal_map: Array, cost: Array, terminal: Array, begin: int
) -> None:
    """Add what the terminal cost pulls at the positions.

    Parameters
    ----------
    gradient
        Derivative by the positions, changed in place.
    flat
        Positions, stage by stage.
    terminal_map, cost
        State at the last stage per position from `begin` on, and its cost, shape (t, t).
    terminal
        The state that costs nothing, shape (t,).
    """
    size = len(terminal)
    error, pull = np.empty(size), np.zeros(size)
    for row in range(size):
        error[row] = -terminal[row]
        for place in range(size):
            error[row] += terminal_map[row, place] * flat[begin + place]
    for row in range(size):
        for inner in range(size):
            pull[row] += cost[row, inner] * error[inner]
    for row in range(size):
        for place in range(size):
            gradient[begin + place] += pull[row] * terminal_map[row, place]


@part
def _velocity_rows(turn: Array, period_s: float, velocity: Array) -> None:
    """Set what the velocity is in terms of a position and the next one: E' times their difference."""
    axes = len(turn)
    for axis in range(axes):
        for place in range(axes):
            back = turn[place, axis] / period_s
            velocity[axis, place], velocity[axis, axes + place] = -back, back


@part
def _write(values: Array, rows: Array, first: int) -> None:
    """Write some rows from `first` on: numba takes seconds to compile that as an assignment of slices."""
    for row in range(values.shape[0]):
        for place in range(values.shape[1]):
            rows[first + row, place] = values[row, place]


@part
def _lagged_inputs(rows: Array, actuator: Array, later: Array, pole: Array, feedback: Array) -> None:
    """Set the rows of inputs that lead from an actuator to the next one, a stage later."""
    axes = len(pole)
    for axis in range(axes):
        row, share = rows[2 * axes + axis], 1.0 - pole[axis]
        for place in range(4 * axes):
            row[place] = 0.0
            if place >= axes:
                row[place] = later[axis, place - axes] / share
            if place < 3 * axes:
                row[place] -= pole[axis] * (actuator[axis, place] / share)
            if place < 2 * axes:
                row[place] += feedback[axis] * rows[axes + axis, place]


@compiled(BLOCKS, BLOCKS, VECTOR, VECTOR, ANY_VECTOR, FLAG, NUMBER, BLOCKS, MATRIX)
def rows_of_positions(
    turn: Array,
    transition: Array,
    push: Array,
    pole: Array,
    feedback: Array,
    lagged: bool,
    period_s: float,
    rows: Array,
    terminal_map: Array,
) -> None:
    """Set what velocities, actuators and inputs are in terms of positions.

    Parameters
    ----------
    turn, transition
        E, orthogonal, and F of the stages, at least N + levels - 2 and one less, shape (.., m, m).
    push
        Velocity per actuator and stage, shape (m,).
    pole, feedback
        Of the lag, and what is subtracted from inputs per velocity ahead of it, shape (m,).
    lagged
        Whether there is a lag.
    rows
        Rows of velocities (m to 2 m) and inputs (2 m to 3 m) are set, but for those of the last input; shape
        (N, r, w).
    terminal_map
        Rows of velocity and actuator of the last stage are set, shape (levels m, levels m).
    """
    stages, axes = len(rows), len(push)
    actuator, before = np.zeros((axes, 3 * axes)), np.zeros((axes, 3 * axes))
    velocity, after = np.empty((axes, 2 * axes)), np.empty((axes, 2 * axes))
    _velocity_rows(turn[0], period_s, velocity)
    for stage in range(len(transition)):
        _velocity_rows(turn[stage + 1], period_s, after)
        for axis in range(axes):
            for place in range(2 * axes):
                carried = 0.0
                for other in range(axes):
                    carried += transition[stage, axis, other] * velocity[other, place]
                # After this stage it is about the position after the next one.
                actuator[axis, place] = -carried
            for place in range(axes):
                actuator[axis, axes + place] += after[axis, place]
                actuator[axis, 2 * axes + place] = after[axis, axes + place]
            for place in range(3 * axes):
                actuator[axis, place] /= push[axis]
        if stage < stages:
            _write(velocity, rows[stage], axes)
        if lagged and 0 < stage <= stages - 1:
            _lagged_inputs(rows[stage - 1], before, actuator, pole, feedback)
        elif not lagged and stage < stages - 1:
            _write(actuator, rows[stage], 2 * axes)
        if lagged and stage == stages - 1:
            _write(actuator, terminal_map, 2 * axes)
        before, actuator = actuator, before
        velocity, after = after, velocity
    if len(transition) < stages:
        _write(velocity, rows[stages - 1], axes)
    for axis in range(axes, 2 * axes):
        for place in range(2 * axes):
            terminal_map[axis, place] = rows[stages - 1, axis, place]


@compiled(VECTOR, FLAG, ANY_MATRIX, ANY_VECTOR, BLOCKS, MATRIX, VECTOR, NUMBER)
def chain_start(
    flat: Array,
    shifted: bool,
    first_state: Array,
    disturbance: Array,
    turns: Array,
    transition: Array,
    push: Array,
    period_s: float,
) -> None:
    """Set the positions that a measured state determines, and those from which a solve begins.

    Parameters
    ----------
    flat
        Positions, stage by stage, but for the last stage, which is padding.
    shifted
        Whether the others are those of the present positions one stage on, or all where the state leads to.
    first_state
        Position, velocity[, actuator] of stage 1, shape (levels, m).
    disturbance
        Acceleration, shape (m,).
    turns, transition
        E of the first two stages, shape (2, m, m), and F of the first one, shape (m, m).
    push
        Velocity per actuator and stage, shape (m,).
    """
    levels, axes = first_state.shape
    if shifted:
        for at in range(len(flat) - 2 * axes):
            flat[at] = flat[at + axes]
    moved = first_state[1].copy()
    for level in range(levels):
        for axis in range(axes):
            at = level * axes + axis
            if level == 0:
                flat[at] = first_state[0, axis]
                continue
            flat[at] = flat[at - axes]
            for other in range(axes):
                flat[at] += period_s * turns[level - 1, axis, other] * moved[other]
        if level == 1 and levels == 3:
            for axis in range(axes):
                moved[axis] = push[axis] * first_state[2, axis] + period_s * disturbance[axis]
                for other in range(axes):
                    moved[axis] += transition[axis, other] * first_state[1, other]
    if not shifted:
        for at in range(levels * axes, len(flat) - axes):
            flat[at] = flat[at - axes]


@compiled(BLOCKS, MATRIX, MATRIX, COUNT, COUNT, MATRIX)
def chain_factor(rows: Array, weights: Array, terminal: Array, axes: int, fixed: int, factor: Array) -> bool:
    """Set the banded Cholesky factor of the Hessian with respect to the free positions.

    Parameters
    ----------
    rows, weights
        Shapes (N, r, w) and (N, r).
    terminal
        Hessian of the terminal cost by the positions from the last stage on, shape (t, t).
    axes
        m.
    fixed
        How many of the first positions are not free.
    factor
        Set to it: entries (i, i) to (i + w - 1, i) in row i, shape (free, w).

    Returns
    -------
    bool
        Whether the Hessian is definite.
    """
    stages, count, width = rows.shape
    size = (stages - 1) * axes + width
    band = np.zeros((size, width))
    for stage in range(stages):
        begin = stage * axes
        for row in range(count):
            weight = weights[stage, row]
            if weight != 0.0:
                for place in range(width):
                    share = weight * rows[stage, row, place]
                    if share != 0.0:
                        for further in range(place, width):
                            band[begin + place, further - place] += share * rows[stage, row, further]
    begin = (stages - 1) * axes
    for place in range(len(terminal)):
        for further in range(place, len(terminal)):
            band[begin + place, further - place] += terminal[place, further]
    # The last positions are padding: no row depends on them.
    for column in range(len(factor)):
        for place in range(width):
            factor[column, place] = band[fixed + column, place]
    for column in range(len(factor)):
        pivot = factor[column, 0]
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        below = min(width, len(factor) - column)
        factor[column, 0] = pivot
        for place in range(1, below):
            factor[column, place] /= pivot
        for place in range(1, below):
            share = factor[column, place]
            if share != 0.0:
                for further in range(place, below):
                    factor[column + place, further - place] -= share * factor[column, further]
    return True


@part
def chain_solve(factor: Array, solution: Array) -> None:
    """Replace a right side, shape (free,), by the solution with a factor of `chain_factor`."""
    size, width = factor.shape
    for column in range(size):
        value = solution[column] / factor[column, 0]
        solution[column] = value
        for place in range(1, min(width, size - column)):
            solution[column + place] -= factor[column, place] * value
    for column in range(size - 1, -1, -1):
        value = solution[column]
        for place in range(1, min(width, size - column)):
            value -= factor[column, place] * solution[column + place]
        solution[column] = value / factor[column, 0]


@compiled(BLOCKS, VECTOR, MATRIX, MATRIX, VECTOR, MATRIX, MATRIX, COUNT, VECTOR)
def chain_step(
    rows: Array,
    flat: Array,
    terminal_map: Array,
    cost: Array,
    terminal: Array,
    factor: Array,
    pull: Array,
    fixed: int,
    step: Array,
) -> None:
    """Newton step of the free positions from a point, where the derivative of the cost by the rows is `pull`.

    Parameters
    ----------
    rows, flat, terminal_map, cost, terminal
        As in `chain_values` and `add_terminal_gradient`.
    factor
        Of `chain_factor`.
    fixed
        How many of the first positions are not free.
    step
        Set to it, shape (free,).
    """
    stages, _, width = rows.shape
    axes = (len(flat) - width) // (stages - 1)
    gradient = np.empty(len(flat))
    chain_gradient(rows, pull, axes, gradient)
    add_terminal_gradient(gradient, flat, terminal_map, cost, terminal, (stages - 1) * axes)
    for place in range(len(step)):
        step[place] = -gradient[fixed + place]
    chain_solve(factor, step)


@compiled(BLOCKS, MATRIX, VECTOR, COUNT, COUNT)
def chain_roll_out(rows: Array, inputs: Array, flat: Array, axes: int, first_row: int) -> None:
    """Set the positions that inputs lead to, from those that are fixed on.

    Parameters
    ----------
    rows
        Shape (N, r, w); those from `first_row` on are the inputs'.
    inputs
        Shape (N - 1, m).
    flat
        Positions, stage by stage; the first ones are given, the others are set.
    axes
        m, 1 or 2.
    """
    width = rows.shape[2]
    known = width - axes
    for stage in range(len(inputs)):
        begin = stage * axes
        left = np.empty(axes)
        for axis in range(axes):
            left[axis] = inputs[stage, axis]
            for place in range(known):
                left[axis] -= rows[stage, first_row + axis, place] * flat[begin + place]
        if axes == 1:
            flat[begin + known] = left[0] / rows[stage, first_row, known]
        else:
            a, b = rows[stage, first_row, known], rows[stage, first_row, known + 1]
            c, d = rows[stage, first_row + 1, known], rows[stage, first_row + 1, known + 1]
            scale = 1.0 / (a * d - b * c)
            flat[begin + known] = scale * (d * left[0] - b * left[1])
            flat[begin + known + 1] = scale * (a * left[1] - c * left[0])
