"""Kernels of the active-set method (`rcopterx.control.controllers.chains.active_set`), for both chains.

An attempt begins a solve or goes on with one, factorises if the known factor is of other bounds, takes Newton
steps until other bounds press or the problem is solved, and writes the plan down: one call for all that a
solve needs where nothing presses, or what presses was guessed.
"""

from typing import Final

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    BLOCKS,
    COUNT,
    FLAG,
    MATRIX,
    NUMBER,
    TARGET,
    VECTOR,
    Array,
    compiled,
    part,
)
from rcopterx.native.bounds import (
    add_penalties,
    any_nonzero,
    differ,
    press,
    pull_at,
    update_multipliers,
)
from rcopterx.native.chain import chain_factor, chain_start, chain_step, chain_values
from rcopterx.native.lateral import lateral_begin, lateral_factor, lateral_rows, lateral_step

CHAIN: Final = (
    BLOCKS, MATRIX, MATRIX, MATRIX, BLOCKS, MATRIX, VECTOR, ANY_VECTOR, MATRIX, MATRIX, VECTOR, *3 * [MATRIX],
    *3 * [NUMBER],
)  # fmt: skip
LATERAL: Final = (
    *5 * [MATRIX], BLOCKS, BLOCKS, VECTOR, BLOCKS, MATRIX, MATRIX, VECTOR, *4 * [MATRIX], NUMBER, NUMBER,
)  # fmt: skip
"""Types of what attempts know of their problems, which comes first."""
FLAT: Final = 10
CHAIN_SIDE: Final = 12
CHAIN_MULTIPLIERS: Final = 13
"""Where positions and what presses are in what is known of a chain."""
TURN: Final = 5
DEMAND_TURN: Final = 6
DEMANDS: Final = 11
STATES: Final = 12
LATERAL_SIDE: Final = 14
LATERAL_MULTIPLIERS: Final = 15
"""Where turns, demands, states and what presses are in what is known of the lateral problem."""
FACTOR_OF_CHAIN: Final = MATRIX, MATRIX
FACTOR_OF_LATERAL: Final = BLOCKS, MATRIX
"""Types of factors and what presses in them."""
GO_ON = 0
AFRESH = 1
SHIFTED = 2
"""Where an attempt begins: at the present point, with no inputs at all, or at the last plan one stage on."""


@part
def chain_settle(
    rows: Array,
    flat: Array,
    terminal_map: Array,
    cost: Array,
    terminal: Array,
    factor: Array,
    aim: Array,
    weights: Array,
    penalty: Array,
    lower: Array,
    upper: Array,
    values: Array,
    side: Array,
    multipliers: Array,
    first: int,
    fixed: int,
    most: int,
    hardness: float,
    tolerance: float,
) -> tuple[int, bool, bool]:
    """Newton steps and updates of the multipliers with one factor, until other bounds press or it is solved.

    Parameters
    ----------
    rows, terminal_map, cost, terminal, factor, fixed
        As in `chain_step`.
    aim, weights, penalty, lower, upper, side, multipliers, first
        As in `pull_at`; the penalty is positive where a row is bounded.
    flat, values, side, multipliers
        Point, its rows and what presses there, changed in place.
    most
        Number of steps after which it ends.
    hardness
        Penalty of the inputs.
    tolerance
        Distance of inputs to their bounds up to which it is solved.

    Returns
    -------
    tuple
        Number of steps, whether it is solved, and whether what presses is still what the factor is of.
    """
    stages, _, width = rows.shape
    axes = (len(flat) - width) // (stages - 1)
    pull, step = np.empty(values.shape), np.empty(len(factor))
    chain_values(rows, flat, axes, values)
    for count in range(1, most + 1):
        pull_at(values, aim, weights, penalty, side, multipliers, lower, upper, first, pull)
        chain_step(rows, flat, terminal_map, cost, terminal, factor, pull, fixed, step)
        for place in range(len(step)):
            flat[fixed + place] += step[place]
        chain_values(rows, flat, axes, values)
        if not press(values, penalty, multipliers, lower, upper, first, hardness, side):
            return count, False, False
        if update_multipliers(values, multipliers, lower, upper, first, hardness) <= tolerance:
            return count, True, True
    return most, False, True


@compiled(*CHAIN, ANY_MATRIX, ANY_VECTOR, COUNT, *FACTOR_OF_CHAIN, FLAG, *TARGET, COUNT, MATRIX, MATRIX)
def chain_attempt(
    rows: Array,
    terminal_map: Array,
    cost: Array,
    hessian: Array,
    turns: Array,
    transition: Array,
    push: Array,
    gain: Array,
    weights: Array,
    penalty: Array,
    flat: Array,
    values: Array,
    side: Array,
    multipliers: Array,
    period_s: float,
    hardness: float,
    tolerance: float,
    first_state: Array,
    disturbance: Array,
    begin: int,
    factor: Array,
    of: Array,
    stale: bool,
    aim: Array,
    terminal: Array,
    lower: Array,
    upper: Array,
    most: int,
    positions: Array,
    inputs: Array,
) -> tuple[int, bool, bool, bool]:
    """One attempt at the problem of a chain of integrators.

    Parameters
    ----------
    rows, terminal_map, cost, weights, penalty, flat, values, side, multipliers, hardness, tolerance
        As in `chain_settle`.
    hessian
        Of the terminal cost, as in `chain_factor`.
    turns, transition, push, period_s, first_state, disturbance
        As in `chain_start`.
    gain
        Acceleration per actuator, shape (m,).
    begin
        `GO_ON`, `AFRESH` or `SHIFTED`.
    factor, of
        Factor of the Hessian and the sides it is of, renewed where these are not the present ones; `of` has
        no rows where they always are.
    stale
        Whether the factor has to be renewed anyway.
    aim, terminal, lower, upper, most
        As in `chain_settle`.
    positions, inputs
        Once it is solved, set to the plan, the inputs without what balances the disturbance; shapes
        (N + levels - 1, m) and (N - 1, m).

    Returns
    -------
    tuple
        Number of steps, zero where the Hessian is not definite; whether it is solved; whether what presses is
        still what the factor is of; whether anything presses.
    """
    axes = len(push)
    fixed, first = rows.shape[2] - axes, 2 * axes
    if begin != GO_ON:
        chain_start(flat, begin == SHIFTED, first_state, disturbance, turns, transition, push, period_s)
    if stale or differ(of, side):
        total = np.empty(weights.shape)
        add_penalties(weights, penalty, side, of, total)
        if not chain_factor(rows, total, hessian, axes, fixed, factor):
            return 0, False, False, True
    count, solved, same = chain_settle(
        rows, flat, terminal_map, cost, terminal, factor, aim, weights, penalty, lower, upper, values, side,
        multipliers, first, fixed, most, hardness, tolerance,
    )  # fmt: skip
    if solved:
        for stage in range(len(positions)):
            for axis in range(axes):
                positions[stage, axis] = flat[stage * axes + axis]
        for stage in range(len(inputs)):
            for axis in range(axes):
                inputs[stage, axis] = values[stage, first + axis] - disturbance[axis] / gain[axis]
    return count, solved, same, any_nonzero(side)


@part
def pull_of_last(terminal: Array, state: Array, aim: Array, pull: Array) -> None:
    """Set the derivative of the terminal cost by the last state."""
    for row in range(len(aim)):
        total = 0.0
        for inner in range(len(aim)):
            total += terminal[row, inner] * (state[inner] - aim[inner])
        pull[row] = total


@part
def lateral_settle(
    transition: Array,
    carried: Array,
    demand: Array,
    terminal: Array,
    factor: Array,
    aim_of_last: Array,
    demands: Array,
    states: Array,
    turn: Array,
    demand_turn: Array,
    gain: Array,
    directions: Array,
    aim: Array,
    weights: Array,
    penalty: Array,
    lower: Array,
    upper: Array,
    values: Array,
    side: Array,
    multipliers: Array,
    most: int,
    hardness: float,
    tolerance: float,
) -> tuple[int, bool, bool]:
    """Newton steps and updates of the multipliers with one factor, until other bounds press or it is solved.

    Parameters
    ----------
    transition, carried, demand, factor, turn, demand_turn, gain, directions
        As in `lateral_step`.
    terminal, aim_of_last
        Cost of the last state, and the state that costs nothing.
    demands, states, values, side, multipliers
        Point, its states and rows and what presses there, changed in place; states as in `lateral_states`.
    aim, weights, penalty, lower, upper, most, hardness, tolerance
        As in `chain_settle`.

    Returns
    -------
    tuple
        Number of steps, whether it is solved, and whether what presses is still what the factor is of.
    """
    pull, step = np.empty(values.shape), np.empty(len(demands))
    pull_last, moved = np.empty(len(aim_of_last)), np.empty(states.shape)
    lateral_rows(states, demands, turn, demand_turn, gain, directions, values)
    for count in range(1, most + 1):
        pull_at(values, aim, weights, penalty, side, multipliers, lower, upper, 4, pull)
        pull_of_last(terminal, states[len(turn) - 1], aim_of_last, pull_last)
        lateral_step(
            transition, carried, demand, factor, pull, pull_last, turn, demand_turn, gain, directions,
            step, moved,
        )  # fmt: skip
        for place in range(len(step)):
            demands[place] += step[place]
        for stage in range(len(states)):
            for row in range(len(aim_of_last)):
                states[stage, row] += moved[stage, row]
        lateral_rows(states, demands, turn, demand_turn, gain, directions, values)
        if not press(values, penalty, multipliers, lower, upper, 4, hardness, side):
            return count, False, False
        if update_multipliers(values, multipliers, lower, upper, 4, hardness) <= tolerance:
            return count, True, True
    return most, False, True


@compiled(*LATERAL, VECTOR, ANY_VECTOR, COUNT, *FACTOR_OF_LATERAL, FLAG, *TARGET, COUNT, MATRIX, MATRIX)
def lateral_attempt(
    transition: Array,
    carried: Array,
    demand: Array,
    cost: Array,
    endless: Array,
    turn: Array,
    demand_turn: Array,
    gain: Array,
    directions: Array,
    weights: Array,
    penalty: Array,
    demands: Array,
    states: Array,
    values: Array,
    side: Array,
    multipliers: Array,
    hardness: float,
    tolerance: float,
    first_state: Array,
    trim: Array,
    begin: int,
    factor: Array,
    of: Array,
    stale: bool,
    aim: Array,
    terminal: Array,
    lower: Array,
    upper: Array,
    most: int,
    positions: Array,
    inputs: Array,
) -> tuple[int, bool, bool, bool]:
    """One attempt at the horizontal problem of a vehicle with a tilt model.

    Parameters
    ----------
    transition, carried, demand, turn, demand_turn, gain, directions, weights, penalty, demands, states,
    values, side, multipliers, hardness, tolerance
        As in `lateral_settle`.
    cost, endless
        Cost of the last state, and the factor of the endless horizon, as in `lateral_factor`.
    first_state
        State at stage 1, shape (n,).
    trim
        Offsets of the sticks, taken off the planned ones, shape (2,).
    begin, factor, of, stale, aim, lower, upper, most, positions, inputs
        As in `chain_attempt`.
    terminal
        The last state that costs nothing, shape (n,).

    Returns
    -------
    tuple
        As of `chain_attempt`.
    """
    if begin != GO_ON:
        lateral_begin(carried, demand, first_state, begin == SHIFTED, demands, states)
    if stale or differ(of, side):
        total = np.empty(weights.shape)
        add_penalties(weights, penalty, side, of, total)
        if not lateral_factor(
            transition, demand, cost, endless, weights, total, turn, demand_turn, gain, directions, factor
        ):
            return 0, False, False, True
    count, solved, same = lateral_settle(
        transition, carried, demand, cost, factor, terminal, demands, states, turn, demand_turn, gain,
        directions, aim, weights, penalty, lower, upper, values, side, multipliers, most, hardness, tolerance,
    )  # fmt: skip
    if solved:
        for stage in range(len(positions)):
            positions[stage, 0], positions[stage, 1] = states[stage, 0], states[stage, 1]
        for stage in range(len(inputs)):
            for axis in range(2):
                inputs[stage, axis] = values[stage, 4 + axis] - trim[axis]
    return count, solved, same, any_nonzero(side)
