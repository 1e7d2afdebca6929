"""Promises of the transition table that hold in every state they are made for, whatever else is the case."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.transmitter_gateway.inputs import FLYING, State
from rcopterx.transmitter_gateway.transitions import Condition, find_transition

STANDING = (State.DISARMED, State.CUT)
OBEYING = (State.ARMED, State.HOLD)
COMING_DOWN = (State.LAND, State.DESCEND)
WELL = {Condition.READY, Condition.FRESH}
DOWN = {frozenset({Condition.SEEN, Condition.AIRBORNE}): State.LAND, frozenset(): State.DESCEND}
"""Where vehicles that come down go to, by what is seen of them."""

flying = st.sampled_from(sorted(FLYING))
anything = st.sets(st.sampled_from(Condition))


def after(state: State, *conditions: Condition) -> State:
    """State after one step."""
    row = find_transition(state, frozenset(conditions))
    return state if row is None else row.target


@given(st.sampled_from(State), anything)
def test_a_kill_kills_in_every_state_whatever_else_is_the_case(state: State, others: set[Condition]) -> None:
    others.discard(Condition.RESET)
    assert after(state, Condition.KILL, *others) is State.KILLED


@given(st.sampled_from([*sorted(FLYING), State.CUT]), anything)
def test_without_its_serial_link_nothing_stays_armed(state: State, others: set[Condition]) -> None:
    others.discard(Condition.KILL)
    assert after(state, Condition.LINK_LOST, *others) is State.DISARMED


@given(flying, st.sampled_from([Condition.GROUNDED, Condition.SEEN]))
def test_a_vehicle_on_the_floor_is_disarmed_in_every_state(state: State, floor: Condition) -> None:
    assert after(state, Condition.DISARM, floor, *WELL) is State.DISARMED


@given(flying)
def test_a_vehicle_in_the_air_is_not_disarmed(state: State) -> None:
    assert after(state, Condition.DISARM, Condition.SEEN, Condition.AIRBORNE, *WELL) is not State.DISARMED


@given(flying)
def test_a_gateway_that_shuts_down_cuts_what_stands_on_the_floor(state: State) -> None:
    assert after(state, Condition.SHUTDOWN, Condition.GROUNDED, *WELL) is State.CUT


@pytest.mark.parametrize("state", OBEYING)
@pytest.mark.parametrize(("seen", "target"), DOWN.items())
@pytest.mark.parametrize(
    "conditions",
    [
        {Condition.SHUTDOWN, *WELL},
        {Condition.DESCEND_CAUSE, *WELL},
        {Condition.SILENT, Condition.READY},
        {Condition.FRESH},
    ],
    ids=["shutting-down", "raw-poses", "commands-silent", "not-ready"],
)
def test_what_brings_a_vehicle_down_does_so_from_every_state_in_which_it_is_in_the_air(
    state: State, conditions: set[Condition], seen: frozenset[Condition], target: State
) -> None:
    assert after(state, *conditions, *seen) is target


@pytest.mark.parametrize(("seen", "target"), DOWN.items())
def test_a_hold_that_lasts_too_long_ends_on_the_floor(seen: frozenset[Condition], target: State) -> None:
    assert after(State.HOLD, Condition.HOLD_OVER, Condition.READY, *seen) is target


@pytest.mark.parametrize("state", [State.HOLD, *COMING_DOWN])
def test_fresh_commands_count_again_only_with_a_transmitter_that_is_ready(state: State) -> None:
    seen = {Condition.SEEN, Condition.AIRBORNE}
    assert after(state, *WELL, *seen) is State.ARMED
    assert after(state, Condition.FRESH, *seen) is not State.ARMED


@pytest.mark.parametrize(("seen", "target"), DOWN.items())
def test_a_gateway_takes_over_only_what_it_can_bring_down(seen: frozenset[Condition], target: State) -> None:
    assert after(State.DISARMED, Condition.TAKE_OVER, *seen) is target
    assert after(State.DISARMED, Condition.TAKE_OVER, Condition.SHUTDOWN, *seen) is target
    assert after(State.DISARMED, Condition.TAKE_OVER, Condition.LINK_LOST, *seen) is State.DISARMED


@pytest.mark.parametrize("state", STANDING)
@pytest.mark.parametrize(
    "obstacle",
    [Condition.SHUTDOWN, Condition.LINK_LOST, Condition.HOLD_CAUSE, Condition.DESCEND_CAUSE],
)
def test_nothing_is_armed_with_an_obstacle(state: State, obstacle: Condition) -> None:
    wanted = {Condition.ARM, Condition.LOW_COMMANDED, *WELL}
    assert after(state, *wanted) is State.ARMED
    assert after(state, *wanted, obstacle) is not State.ARMED
